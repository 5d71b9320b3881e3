/* A scene in the browser: what sf_view's page asks for, answered. Pictures come from the rooms that sim_render uses. */
#ifndef SF_SIM_VIEW_VIEWER_H
#define SF_SIM_VIEW_VIEWER_H
#include "view/view.h"

typedef struct sf_viewer_options {
  const char *scene;  /* NULL: the replay's */
  const char *data;   /* NULL: none */
  const char *split;  /* NULL: test */
  const char *model;  /* of the float source; NULL: there is none */
  const char *replay; /* a difference of sf_cosim, or NULL */
  int steps;          /* 0: the scene's t_r */
  int downscale;      /* as sf_dataset_options */
  float scale;        /* 0: the scene's */
} sf_viewer_options;

typedef struct sf_viewer sf_viewer;
/* The strings of the options are kept, not copied. */
sf_status sf_viewer_open(sf_viewer **viewer, const sf_viewer_options *options);
/* For sf_view_options; user is the viewer. */
extern const sf_view_route sf_viewer_routes[];
/* What looks wrong with the data set. */
void sf_viewer_warn(const sf_viewer *viewer, FILE *out, const char *program);
cJSON *sf_viewer_json(sf_viewer *viewer); /* scene, steps, sources, maps, views */
void sf_viewer_close(sf_viewer *viewer);  /* NULL is fine */
#endif
