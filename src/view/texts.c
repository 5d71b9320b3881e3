/* The pages, inside the program: it needs no file beside it. */
#include "view/view.h"
#include "page/draw.h"
#include <stdlib.h>

/* A file of this folder, from the root of the repository, and a 0 behind it. */
#define TEXT(name, file)                                                                                               \
  __asm__(".pushsection .rodata\n"                                                                                     \
          ".global " #name "\n"                                                                                        \
          ".hidden " #name "\n" #name ": .incbin \"src/view/" file "\"\n"                                              \
          ".byte 0\n"                                                                                                  \
          ".popsection")

TEXT(view_scene_html, "scene.html");
TEXT(view_common_js, "common.js");
TEXT(view_camera_js, "camera.js");
TEXT(view_picture_js, "picture.js");
TEXT(view_story_js, "story.js");
TEXT(view_difference_js, "difference.js");
TEXT(view_scene_js, "scene.js");
TEXT(view_training_html, "training.html");
TEXT(view_training_js, "training.js");
TEXT(view_style, "view.css");
extern const char view_scene_html[], view_common_js[], view_camera_js[], view_picture_js[], view_story_js[],
    view_difference_js[], view_scene_js[], view_training_html[], view_training_js[], view_style[];

static sf_status put_style(FILE *out, const sf_template_value *value, void *user)
{
  (void)value, (void)user;
  fputs(html_style, out), fputs(view_style, out);
  return sf_ok();
}

static sf_status put_script(FILE *out, const sf_template_value *value, void *user)
{
  (void)value;
  for (const char *const *text = user; *text; text++) fputs(*text, out);
  return sf_ok();
}

sf_status sf_view_page_make(sf_view_page page, sf_view_reply *reply)
{
  static const sf_template_call functions[] = {{"style", 0, put_style}, {"script", 0, put_script}, {NULL, 0, NULL}};
  static const char *const of_scene[] = {
      view_common_js, view_camera_js, view_picture_js, view_story_js, view_difference_js, view_scene_js, NULL};
  static const char *const of_training[] = {view_common_js, view_training_js, NULL};
  const bool scene = page == SF_VIEW_PAGE_SCENE;
  char *text = NULL;
  cJSON *nothing = cJSON_CreateObject();
  const sf_template filled = {scene ? "scene.html" : "training.html", scene ? view_scene_html : view_training_html,
                              nothing, functions, (void *)(scene ? of_scene : of_training)};
  FILE *out = open_memstream(&text, &reply->size);
  sf_status status = out && nothing ? sf_template_fill(out, &filled) : sf_fail(SF_E_MEMORY, "no memory for the page");
  if (out && fclose(out) && status.code == SF_OK) status = sf_fail(SF_E_MEMORY, "no memory for the page");
  cJSON_Delete(nothing);
  reply->data = text, reply->type = "text/html; charset=utf-8";
  return status;
}
