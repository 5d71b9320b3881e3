/* What the page saves: the golden picture as sim_render writes it, and the command that makes it again. */
#include "sim/view/internal.h"
#include "base/io.h"
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* For a shell. */
static void put_word(FILE *out, const char *word)
{
  fputc('\'', out);
  for (; *word; word++) fputs(*word == '\'' ? "'\\''" : (char[]){*word, 0}, out);
  fputc('\'', out);
}

static void put_path(FILE *out, const char *path)
{
  char *whole = realpath(path, NULL);
  fputc(' ', out);
  put_word(out, whole ? whole : path);
  free(whole);
}

static void put_command(FILE *out, const sf_viewer *v, const sf_view_ask *ask, const sf_sight *sight)
{
  const sf_studio_options *o = &v->fixed.options;
  const sf_window *w = &sight->window;
  const sf_camera *camera = &sight->view.camera;
  char text[SF_CAMERA_TEXT];
  fprintf(out, "sim_render");
  put_path(out, o->scene);
  if (o->data) put_path(out, o->data);
  sf_camera_print(camera, text);
  if (sight->index >= 0)
    fprintf(out, " --view %d", sight->index);
  else
    fprintf(out, " --camera %s", text);
  if (o->data && strcmp(o->split, "test") != 0) fprintf(out, " --split "), put_word(out, o->split);
  if (o->downscale) fprintf(out, " --downscale %d", o->downscale);
  if (o->scale > 0) fprintf(out, " --scale %.9g", (double)o->scale);
  fprintf(out, " --steps %d", sight->steps);
  if (w->width != camera->width || w->height != camera->height)
    fprintf(out, " --crop %d,%d,%d,%d", w->x, w->y, w->width, w->height);
  if (ask->source != SF_VIEW_FIXED) fprintf(out, " --backend %s", sf_view_source_names[ask->source]);
  if (ask->source == SF_VIEW_FLOAT) fprintf(out, " --model"), put_path(out, v->real.model_path);
  fprintf(out, " -o golden.exr --png golden.png\n");
}

static sf_status save_command(const sf_viewer *v, const sf_view_ask *ask, const sf_sight *sight, sf_view_reply *reply)
{
  char *text = NULL;
  FILE *out = open_memstream(&text, &reply->size);
  if (!out) return sf_fail(SF_E_MEMORY, "no memory for a reply");
  put_command(out, v, ask, sight);
  if (fclose(out)) return free(text), sf_fail(SF_E_MEMORY, "no memory for a reply");
  reply->data = text, reply->type = "text/plain; charset=utf-8";
  return sf_ok();
}

/* In a folder of its own, whose name nobody chose. */
static sf_status read_back(const sf_studio *studio, const sf_shot *shot, bool png, sf_view_reply *reply)
{
  const char *base = getenv("TMPDIR");
  char folder[4096], path[4096 + 16], *data = NULL;
  snprintf(folder, sizeof folder, "%s/sf_view-XXXXXX", base && *base ? base : "/tmp");
  if (!mkdtemp(folder)) return sf_fail(SF_E_IO, "cannot make a temporary folder");
  snprintf(path, sizeof path, "%s/golden", folder);
  sf_status status = png ? sf_golden_save_png(&shot->golden, path) : sf_shot_save(studio, shot, path);
  if (status.code == SF_OK) status = sf_read_file(path, (size_t)1 << 30, &data, &reply->size);
  unlink(path), rmdir(folder);
  reply->data = data, reply->type = png ? "image/png" : "image/x-exr", reply->file = png ? "golden.png" : "golden.exr";
  return status;
}

static sf_status open_shot(const sf_studio *studio, const sf_sight *sight, sf_shot *shot)
{
  if (sight->index < 0) return sf_shot_from(studio, &sight->view.camera, shot);
  return sf_shot_load(studio, sight->index, shot);
}

/* The page waits; the next tile of a picture too. */
static sf_status render(sf_viewer *v, const sf_studio *studio, const sf_sight *sight, bool png, sf_view_reply *reply)
{
  sf_shot shot;
  SF_TRY(open_shot(studio, sight, &shot));
  shot.window = sight->window;
  pthread_mutex_lock(&v->drawing);
  sf_status status = sf_shot_render(studio, &shot);
  pthread_mutex_unlock(&v->drawing);
  if (status.code == SF_OK) status = read_back(studio, &shot, png, reply);
  sf_shot_free(&shot);
  return status;
}

SF_VIEWER_ANSWER(save)
{
  sf_viewer *v = user;
  sf_sight sight;
  SF_TRY(sf_sight_of(v, ask, &sight));
  if (ask->source == SF_VIEW_FLOAT) SF_TRY(sf_viewer_need_model(v, sight.steps));
  if (ask->source == SF_VIEW_PHOTO) return sf_fail(SF_E_USAGE, "source: a photograph is a file already");
  if (!strcmp(ask->kind, "command")) return save_command(v, ask, &sight, reply);
  if (strcmp(ask->kind, "exr") != 0 && strcmp(ask->kind, "png") != 0)
    return sf_fail(SF_E_USAGE, "kind: expected exr, png or command");
  if (ask->source == SF_VIEW_RTL)
    return sf_fail(SF_E_USAGE, "source: the accelerator's picture is fixed's, byte for byte; save that");
  sf_studio studio = v->fixed;
  studio.scene.net.steps = sight.steps;
  if (ask->source == SF_VIEW_FLOAT) studio.options.backend = SF_BACKEND_FLOAT, studio.model = v->real.model;
  return render(v, &studio, &sight, !strcmp(ask->kind, "png"), reply);
}
