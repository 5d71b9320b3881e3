/* All views of a split: rendered into a folder with a manifest, or rendered again and compared with one. Views are
 * dealt out to ranks; rank 0 alone has the manifest and reports. Every rank has to see the folder. */
#ifndef SF_SIM_VIEW_SET_H
#define SF_SIM_VIEW_SET_H
#include "sim/studio/studio.h"
#include "golden/manifest.h"
#include "ranks/ranks.h"

#define SF_MANIFEST_NAME "manifest.json"
#define SF_CONTACT_NAME "contact.png"

typedef struct sf_view_set {
  sf_studio *studio; /* open */
  char folder[4096]; /* of manifest and pictures */
  char manifest_path[4096 + 16];
  sf_manifest manifest;
  sf_ranks *ranks;                                /* who renders; NULL: this process */
  void (*begin)(void *user, const sf_shot *shot); /* before each view that is rendered here; or NULL */
  void (*tick)(void *user);                       /* on rank 0 of several, several times a second; or NULL */
  void *user;
  int todo, rendered; /* views of this run, on all ranks; todo is known before the first begin */
  uint64_t pixels;    /* of them */
} sf_view_set;

/* Renders the views that folder/manifest.json does not list or whose picture was changed; makes the folder. The
 * manifest is written after every view, so an interruption loses one view at most. A manifest of another origin or
 * with other cameras is refused, SF_E_DIFFERENCE, unless it lists no view. crop: width 0 for whole views. */
sf_status sf_view_set_render(sf_view_set *set, const sf_window *crop);

/* Writes the contact sheet, folder/contact.png, from the pictures that the manifest lists: at least one. path: where it
 * lies. */
sf_status sf_view_set_contact(const sf_view_set *set, char path[4096 + 16]);

/* What became of one view. */
typedef struct sf_verdict {
  const sf_manifest_view *view;
  sf_status picture; /* rendered again: planes and counts */
  sf_status file;    /* the EXR beside the manifest; SF_OK where there is none */
  char note[320];    /* what is worth saying although it is no difference, or "" */
} sf_verdict;
/* Renders the listed views again and compares them. The manifest has to be loaded, and the studio open with its
 * options. only: index of one view, -1 = all that are listed. report is called for every view in turn; *differences
 * counts the views that differ. Fails only if the comparison itself was not possible. */
sf_status sf_view_set_verify(sf_view_set *set, int only, void (*report)(void *user, const sf_verdict *verdict),
                             int *differences);
/* One line or more per view; {"index", "name", "picture", "file", "note"}. */
void sf_verdict_print(FILE *out, const sf_verdict *verdict);
cJSON *sf_verdict_json(const sf_verdict *verdict);
/* Says how long it took, which is not in the manifest. Text: "N views rendered by ...". JSON: backend, manifest,
 * rendered, seconds, pixels_per_second. */
void sf_view_set_print_run(FILE *out, const sf_view_set *set, double seconds);
void sf_view_set_add_run(const sf_view_set *set, double seconds, cJSON *json);
void sf_view_set_free(sf_view_set *set); /* not the studio */
#endif
