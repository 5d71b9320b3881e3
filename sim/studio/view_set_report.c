#include "sim/studio/view_set.h"
#include "base/text.h"

cJSON *sf_verdict_json(const sf_verdict *v)
{
  cJSON *json = cJSON_CreateObject();
  cJSON_AddNumberToObject(json, "index", v->view->index);
  cJSON_AddStringToObject(json, "name", v->view->name);
  cJSON_AddStringToObject(json, "picture", v->picture.code == SF_OK ? "OK" : v->picture.message);
  cJSON_AddStringToObject(json, "file", v->file.code == SF_OK ? "OK" : v->file.message);
  if (v->note[0]) cJSON_AddStringToObject(json, "note", v->note);
  return json;
}

void sf_verdict_print(FILE *out, const sf_verdict *v)
{
  fprintf(out, "view %d %s: %s%s\n", v->view->index, v->view->name,
          v->picture.code == SF_OK ? "OK" : "DIFFERS: ", v->picture.message);
  if (v->file.code != SF_OK) fprintf(out, "    its file DIFFERS: %s\n", v->file.message);
  if (v->note[0]) fprintf(out, "    note: %s\n", v->note);
}

void sf_view_set_add_run(const sf_view_set *set, double seconds, cJSON *json)
{
  cJSON_AddStringToObject(json, "backend", sf_backend_names[set->studio->options.backend]);
  cJSON_AddStringToObject(json, "manifest", set->manifest_path);
  cJSON_AddNumberToObject(json, "rendered", set->rendered);
  cJSON_AddNumberToObject(json, "seconds", seconds);
  cJSON_AddNumberToObject(json, "pixels_per_second", (double)set->pixels / seconds);
}

void sf_view_set_print_run(FILE *out, const sf_view_set *set, double seconds)
{
  if (!set->todo) {
    fprintf(out, "all %d views are there already: nothing was rendered\n", set->manifest.count);
    return;
  }
  fprintf(out, "%d view%s rendered by %s in %.2f s, %.0f pixels/s\n", set->rendered, sf_plural((uint64_t)set->rendered),
          sf_backend_names[set->studio->options.backend], seconds, (double)set->pixels / seconds);
}
