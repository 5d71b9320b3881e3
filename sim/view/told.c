/* What the page is told of the scene, and where each of its questions goes. */
#include "sim/view/internal.h"
#include "page/draw.h"

static SF_VIEWER_ANSWER(page)
{
  (void)user, (void)ask;
  return sf_view_page_make(SF_VIEW_PAGE_SCENE, reply);
}

static SF_VIEWER_ANSWER(scene)
{
  (void)ask;
  return sf_view_reply_json(reply, sf_viewer_json(user));
}

static SF_VIEWER_ANSWER(view)
{
  sf_sight sight;
  char text[SF_CAMERA_TEXT];
  SF_TRY(sf_sight_of(user, ask, &sight));
  cJSON *json = cJSON_CreateObject();
  sf_camera_print(&sight.view.camera, text);
  sf_json_add_text(json, "name", sight.view.name);
  cJSON_AddStringToObject(json, "camera", text);
  return sf_view_reply_json(reply, json);
}

const sf_view_route sf_viewer_routes[] = {{"/", sf_viewer_page},           {"/scene", sf_viewer_scene},
                                          {"/view", sf_viewer_view},       {"/picture", sf_viewer_picture},
                                          {"/save", sf_viewer_save},       {"/story", sf_viewer_story},
                                          {"/replay", sf_viewer_replay},   {"/difference", sf_viewer_difference},
                                          {"/signals", sf_viewer_signals}, {NULL, NULL}};

static void add_maps(cJSON *json)
{
  cJSON *maps = cJSON_AddArrayToObject(json, "maps");
  for (int i = 0; i < SF_MAPS; i++) {
    sf_map_text text;
    sf_map_describe(i, &text);
    cJSON *map = cJSON_CreateObject();
    cJSON_AddStringToObject(map, "key", text.key), cJSON_AddStringToObject(map, "title", text.title);
    cJSON_AddStringToObject(map, "unit", text.unit), cJSON_AddStringToObject(map, "meaning", text.meaning);
    cJSON_AddItemToArray(maps, map);
  }
}

static void add_palette(cJSON *json)
{
  uint8_t palette[4 * (HTML_HEAT + 1)];
  cJSON *colours = cJSON_AddArrayToObject(json, "palette");
  html_heat_palette(palette, HTML_HEAT);
  for (int i = 4; i < 4 * (HTML_HEAT + 1); i++)
    if (i % 4 < 3) cJSON_AddItemToArray(colours, cJSON_CreateNumber(palette[i]));
}

cJSON *sf_viewer_json(sf_viewer *v)
{
  const fx_net *net = &v->fixed.scene.net;
  char camera[SF_CAMERA_TEXT];
  cJSON *json = cJSON_CreateObject();
  sf_camera_print(&v->home, camera);
  sf_json_add_text(json, "scene", v->options.scene);
  if (v->options.data) sf_json_add_text(json, "data", v->options.data);
  cJSON_AddNumberToObject(json, "steps", net->steps), cJSON_AddNumberToObject(json, "steps_max", SF_T_MAX);
  cJSON_AddNumberToObject(json, "views", v->views);
  cJSON_AddStringToObject(json, "camera", camera);
  cJSON_AddBoolToObject(json, "forward_facing", v->data.ndc);
  cJSON_AddBoolToObject(json, "float", v->real.model_path[0] != 0);
  cJSON *middle = cJSON_AddArrayToObject(json, "middle"), *layers = cJSON_AddArrayToObject(json, "layers");
  for (int i = 0; i < 3; i++) cJSON_AddItemToArray(middle, cJSON_CreateNumber(sf_viewer_middle(&v->fixed.scene, i)));
  for (int l = 0; l < SF_LAYERS; l++) {
    cJSON *layer = cJSON_CreateObject();
    cJSON_AddStringToObject(layer, "name", fx_layer_name(l));
    cJSON_AddNumberToObject(layer, "neurons", net->layer[l].n_out);
    cJSON_AddItemToArray(layers, layer);
  }
  cJSON_AddBoolToObject(json, "difference", v->replay != NULL);
  cJSON_AddNumberToObject(json, "near", v->data.ndc ? (double)v->data.ndc_near : 0);
  add_maps(json), add_palette(json);
  return json;
}
