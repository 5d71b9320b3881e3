#ifndef SF_SIM_STUDIO_INTERNAL_H
#define SF_SIM_STUDIO_INTERNAL_H
#include "sim/studio/view_set.h"

/* The views of this run, and what becomes of each. */
typedef struct sf_set_run {
  sf_view_set *set;
  int *index;      /* [set->todo] */
  sf_status ended; /* what ended it, but for an interruption */
  void (*report)(void *user, const sf_verdict *verdict);
  int differences;
} sf_set_run;

/* DIR/NAME */
void sf_set_path(const sf_view_set *set, const char *name, char path[4096 + 80]);
/* The view with its window, rendered and described. */
sf_status sf_set_render(sf_view_set *set, sf_shot *shot, sf_manifest_view *view);
/* As sf_deal.tick: passes it on. */
void sf_set_tick(void *run);
/* Pictures are equal where scene and rays are. */
sf_status sf_set_same(const sf_view_set *set);
/* Behind "stopped", which both begin with: a rank that is lost. */
const char *sf_set_lost(const sf_status *dealt);
#endif
