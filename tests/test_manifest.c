/* The manifest of golden images: canonical hashes against values made by another program, round trips, every edit seen,
 * pixels located. */
#include "ck_run.h"
#include "base/sha256.h"
#include "folder_fixture.h"
#include "base/io.h"
#include "golden/manifest.h"
#include <math.h>

static const fx_net net = {.steps = 2};

static sf_camera some_camera(void)
{
  sf_camera camera = {.width = 3, .height = 1, .fx = 1.5f, .fy = -2.0f, .cx = 0.25f, .cy = 1e-3f};
  for (int i = 0; i < 12; i++) camera.to_world[i] = (float)i / 4 - 1;
  return camera;
}

/* Every plane holds [1, 0x01020304, 2^32-1]; counts of layer l, event e, step t are 1000 l + 100 e + t + 1. */
static sf_golden some_golden(void)
{
  sf_golden g;
  ck_ok(sf_golden_create(&g, 3, 1, SF_PLANES));
  for (int p = 0; p < SF_PLANES; p++)
    memcpy(g.plane[p], (const uint32_t[3]){1, 0x01020304, UINT32_MAX}, 3 * sizeof(uint32_t));
  for (int l = 0; l < SF_LAYERS; l++) {
    for (int e = 0; e < SF_EVENTS; e++)
      for (int t = 0; t < 2; t++) g.counts.layer[l].event[e][t] = (uint64_t)(1000 * l + 100 * e + t + 1);
    g.counts.saturated[l] = (uint64_t)(21 + l), g.counts.saturated_samples[l] = (uint64_t)(41 + l);
  }
  g.counts.samples = 7, g.counts.rays = 5, g.counts.grid_bytes = ((uint64_t)1 << 40) + 3, g.counts.march_steps = 11;
  g.counts.saturated_features = 31;
  return g;
}

static sf_manifest_view describe(const sf_golden *g)
{
  sf_manifest_view view = {0};
  sf_camera camera = some_camera();
  ck_ok(sf_manifest_describe(&view, &net, &camera, g));
  return view;
}

/* Made with Python: hashlib.sha256(struct.pack('<...', ...)), in the order that manifest.h states. */
TEST(hashes_are_those_of_another_program)
{
  OWNED(sf_golden) g = some_golden();
  sf_manifest_view v = describe(&g);
  for (int p = 0; p < SF_PLANES; p++)
    ck_assert_str_eq(v.plane_sha256[p], sf_plane_is_integer((sf_plane)p)
                                            ? "8acbaafe384b75873a6e9036a31820b0071dfaa45ae97930a34a79388745b527"
                                            : "");
  ck_assert_str_eq(v.counts_sha256, "7be01555eb8de460773a5b3f6780889323c7305df64330ad7840c1190ea34ac4");
  ck_assert_str_eq(v.camera_sha256, "f0db282df32c0f4879ef6f766b54c9de68228e766fa445b06fc2b09136ca5ff2");
  ck_assert_int_eq(v.width, 3);
  ck_assert_int_eq(v.height, 1);
  ck_assert_uint_eq(v.event[SF_EVENT_MAC], 2 * (0 + 1000 + 2000 + 3000 + 4000) + 5 * 3);
}

TEST(every_bit_of_a_picture_counts)
{
  OWNED(sf_golden) g = some_golden();
  const sf_manifest_view before = describe(&g);
  int plane, integers = 0;
  for (int p = 0; p < SF_PLANES; p++) {
    sf_golden_int(&g, (sf_plane)p)[2] ^= 1u << 31;
    sf_manifest_view after = describe(&g);
    sf_status status = sf_manifest_same_view(&before, &after, &plane);
    if (sf_plane_is_integer((sf_plane)p)) {
      ck_bad(status, SF_E_DIFFERENCE, "SHA-256", sf_plane_names[p]);
      ck_assert_int_eq(plane, p);
      integers++;
    } else {
      ck_ok(status);
    }
    sf_golden_int(&g, (sf_plane)p)[2] ^= 1u << 31;
  }
  ck_assert_int_eq(integers, 11);
}

TEST(every_count_counts)
{
  OWNED(sf_golden) g = some_golden();
  const sf_manifest_view before = describe(&g);
  uint64_t *count = (uint64_t *)&g.counts;
  int plane, seen = 0;
  for (size_t i = 0; i < sizeof g.counts / sizeof *count; i++) {
    count[i]++;
    sf_manifest_view after = describe(&g);
    sf_status status = sf_manifest_same_view(&before, &after, &plane);
    seen += status.code == SF_E_DIFFERENCE && plane == -1;
    count[i]--;
  }
  /* All but steps 2 .. T-1, which a net of 2 steps does not run; the totals see those, too. */
  ck_assert_int_eq(seen, (int)(sizeof g.counts / sizeof *count));
  g.counts.layer[FX_C1].sop[1]++, g.counts.layer[FX_C2].sop[1]--; /* totals agree */
  sf_manifest_view moved = describe(&g);
  ck_bad(sf_manifest_same_view(&before, &moved, &plane), SF_E_DIFFERENCE, "counts_sha256", "here it is");
}

TEST(the_camera_is_part_of_the_view)
{
  OWNED(sf_golden) g = some_golden();
  const sf_manifest_view before = describe(&g);
  sf_manifest_view after = before;
  sf_camera camera = some_camera();
  int plane;
  camera.p2 = 1e-6f;
  ck_ok(sf_manifest_describe(&after, &net, &camera, &g));
  ck_bad(sf_manifest_same_view(&before, &after, &plane), SF_E_DIFFERENCE, "camera_sha256", after.camera_sha256);
  camera.p2 = 0;
  camera.to_world[11] = nextafterf(camera.to_world[11], 9);
  ck_ok(sf_manifest_describe(&after, &net, &camera, &g));
  ck_bad(sf_manifest_same_view(&before, &after, &plane), SF_E_DIFFERENCE, "camera_sha256", after.camera_sha256);
}

/* ---- files ---- */

static sf_manifest some_manifest(bool is_float, int views)
{
  sf_manifest m = {.total = 3};
  sf_golden g = some_golden();
  if (is_float) g.planes = SF_FLOAT_PLANES;
  m.origin = (sf_manifest_origin){
      .split = "test", .steps = 2, .downscale = is_float ? 0 : 4, .scale = 0.8f, .crop = {1, 2, 3, 1}};
  sf_sha256("scene", 5, m.origin.scene_sha256);
  if (is_float) sf_sha256("model", 5, m.origin.model_sha256);
  for (int i = 0; i < views; i++) {
    g.counts.samples = 100 + (uint64_t)i;
    sf_manifest_view view = describe(&g);
    view.index = i, view.psnr = 30.12345678 + i, view.ssim = 0.98765432;
    snprintf(view.name, sizeof view.name, "test/r_%d", i);
    snprintf(view.exr, sizeof view.exr, "view_%04d.exr", i);
    sf_sha256(view.exr, 5, view.exr_sha256);
    ck_ok(sf_manifest_put(&m, &view));
  }
  g.planes = SF_PLANES;
  sf_golden_free(&g);
  return m;
}

LOOP_TEST(reads_back_what_it_wrote, 2)
{
  for (int views = 0; views <= 3; views++) {
    sf_manifest m = some_manifest(_i, views), back;
    ck_ok(sf_manifest_save(&m, in("a.json")));
    ck_ok(sf_manifest_load(&back, in("a.json")));
    ck_ok(sf_manifest_same_origin(&m.origin, &back.origin));
    ck_assert_int_eq(back.count, views);
    ck_assert_int_eq(back.total, 3);
    for (int i = 0; i < views; i++) {
      int plane;
      ck_ok(sf_manifest_same_view(&m.view[i], &back.view[i], &plane));
      ck_assert_str_eq(m.view[i].name, back.view[i].name);
      ck_assert_str_eq(m.view[i].exr, back.view[i].exr);
      ck_assert_str_eq(m.view[i].exr_sha256, back.view[i].exr_sha256);
      ck_assert_double_eq(m.view[i].psnr, back.view[i].psnr);
    }
    ck_ok(sf_manifest_save(&back, in("b.json")));
    ck_assert(same_files(in("a.json"), in("b.json")));
    sf_manifest_free(&m), sf_manifest_free(&back);
  }
}

TEST(the_order_of_the_views_does_not_matter)
{
  OWNED(sf_manifest) m = some_manifest(false, 3), other = {.origin = m.origin, .total = 3};
  static const int order[] = {2, 0, 1, 0};
  for (int i = 0; i < 4; i++) ck_ok(sf_manifest_put(&other, &m.view[order[i]]));
  ck_assert_int_eq(other.count, 3);
  ck_assert_ptr_null(sf_manifest_find(&other, 3));
  ck_assert_str_eq(sf_manifest_find(&other, 1)->name, "test/r_1");
  ck_ok(sf_manifest_save(&m, in("a.json")));
  ck_ok(sf_manifest_save(&other, in("b.json")));
  ck_assert(same_files(in("a.json"), in("b.json")));
}

TEST(sums_by_hand)
{
  OWNED(sf_manifest) m = some_manifest(false, 3);
  sf_manifest_sum sum;
  sf_manifest_sums(&m, &sum);
  ck_assert_uint_eq(sum.samples, 100 + 101 + 102);
  ck_assert_uint_eq(sum.pixels, 9);
  ck_assert_uint_eq(sum.event[SF_EVENT_MAC], 3 * 20015);
  ck_assert_uint_eq(sum.energy_fj, 3 * (20015ull * 4600 + 21015ull * 900)); /* sop: 100 more in each of ten places */
  ck_assert_double_eq_tol(sum.psnr, 31.1235, 1e-9);                         /* 30.1235 + 0, 1, 2 */
  m.view[1].psnr = NAN;
  sf_manifest_sums(&m, &sum);
  ck_assert(isnan(sum.psnr));
}

/* ---- every field edited ---- */

static bool noticed(const sf_manifest *m, const sf_manifest *edited)
{
  int plane;
  if (sf_manifest_same_origin(&m->origin, &edited->origin).code != SF_OK) return true;
  if (m->total != edited->total || m->count != edited->count) return true;
  for (int i = 0; i < m->count; i++) {
    const sf_manifest_view *a = &m->view[i], *b = &edited->view[i];
    if (sf_manifest_same_view(a, b, &plane).code != SF_OK) return true;
    if (a->index != b->index || strcmp(a->name, b->name) != 0) return true; /* what sim_render compares itself */
    if (strcmp(a->exr, b->exr) != 0 || strcmp(a->exr_sha256, b->exr_sha256) != 0) return true;
  }
  return false;
}

/* Without the care of sf_json_save, which waits for the disk. */
static void save(const cJSON *json, const char *path)
{
  char *text = cJSON_Print(json);
  FILE *file = fopen(path, "w");
  ck_assert_ptr_nonnull(file);
  ck_assert_int_ge(fputs(text, file), 0);
  ck_assert_int_eq(fclose(file), 0);
  free(text);
}

static void edit(cJSON *item)
{
  if (cJSON_IsString(item)) {
    size_t last = strlen(item->valuestring) - 1;
    item->valuestring[last] = item->valuestring[last] == '7' ? '8' : '7';
  } else if (cJSON_IsNumber(item)) {
    cJSON_SetNumberValue(item, item->valuedouble + 1);
  } else if (cJSON_IsBool(item)) {
    item->type ^= cJSON_True | cJSON_False;
  }
}

/* Leaves are edited in place, one at a time, by their number; returns false when there is no such leaf. */
static cJSON *leaf(cJSON *item, int *number)
{
  if (!cJSON_IsObject(item) && !cJSON_IsArray(item)) return (*number)-- == 0 ? item : NULL;
  for (cJSON *child = item->child; child; child = child->next) {
    cJSON *found = leaf(child, number);
    if (found) return found;
  }
  return NULL;
}

static cJSON *inner(cJSON *item, int *number) /* the n-th object */
{
  if (cJSON_IsObject(item) && (*number)-- == 0) return item;
  for (cJSON *child = item->child; child; child = child->next) {
    cJSON *found = inner(child, number);
    if (found) return found;
  }
  return NULL;
}

LOOP_TEST(every_edit_is_seen, 2)
{
  sf_manifest m = some_manifest(_i, 2), edited;
  ck_ok(sf_manifest_save(&m, in("m.json")));
  int edits = 0;
  for (;; edits++) {
    cJSON *json;
    int number = edits;
    ck_ok(sf_json_load(in("m.json"), &json));
    cJSON *item = leaf(json, &number);
    if (item) {
      edit(item);
      save(json, in("edited.json"));
    }
    const char *key = item && item->string ? item->string : "of an array";
    if (item && sf_manifest_load(&edited, in("edited.json")).code == SF_OK) {
      ck_assert_msg(noticed(&m, &edited), "the edited field %s (number %d) was not noticed", key, edits);
      sf_manifest_free(&edited);
    }
    cJSON_Delete(json);
    if (!item) break;
  }
  ck_assert_int_gt(edits, _i ? 30 : 70);
  sf_manifest_free(&m);
}

LOOP_TEST(missing_and_unknown_fields_are_refused, 2)
{
  sf_manifest m = some_manifest(_i, 2), edited;
  ck_ok(sf_manifest_save(&m, in("m.json")));
  int objects = 0;
  for (;; objects++) {
    int field = 0, fields = 1;
    for (; field <= fields; field++) { /* field == fields: an unknown one is added */
      cJSON *json;
      int number = objects;
      ck_ok(sf_json_load(in("m.json"), &json));
      cJSON *object = inner(json, &number);
      fields = object ? cJSON_GetArraySize(object) : -1;
      if (object && field < fields) cJSON_DeleteItemFromArray(object, field);
      if (object && field == fields) cJSON_AddNumberToObject(object, "surplus", 1);
      if (object) save(json, in("edited.json"));
      cJSON_Delete(json);
      if (object) ck_bad(sf_manifest_load(&edited, in("edited.json")), SF_E_FORMAT, "edited.json", "");
    }
    if (fields < 0) break;
  }
  ck_assert_int_eq(objects, _i ? 1 + 1 + 2 * 2 : 1 + 1 + 2 * 3); /* root, totals; view, counts, planes */
  sf_manifest_free(&m);
}

TEST(other_files_are_refused)
{
  sf_manifest m;
  static const char *const text[] = {"", "[]", "{}", "{\"format\": \"spikefield-golden\", \"version\": 2}", "null"};
  for (size_t i = 0; i < sizeof text / sizeof *text; i++) {
    ck_ok(sf_write_file(in("m.json"), text[i], strlen(text[i])));
    sf_status status = sf_manifest_load(&m, in("m.json"));
    ck_assert(status.code == SF_E_FORMAT || status.code == SF_E_RANGE);
    ck_assert_ptr_nonnull(strstr(status.message, "m.json"));
  }
  ck_bad(sf_manifest_load(&m, in("none.json")), SF_E_IO, "none.json", "");
  sf_manifest elsewhere = some_manifest(false, 1); /* a name that leads out of the folder */
  snprintf(elsewhere.view[0].exr, sizeof elsewhere.view[0].exr, "../x.exr");
  ck_ok(sf_manifest_save(&elsewhere, in("m.json")));
  ck_bad(sf_manifest_load(&m, in("m.json")), SF_E_FORMAT, "view[0]", "exr");
  sf_manifest_free(&elsewhere);
}

TEST(origins_differ_by_name)
{
  OWNED(sf_manifest) m = some_manifest(true, 0);
  const sf_manifest_origin a = m.origin;
  sf_manifest_origin b = a;
  ck_ok(sf_manifest_same_origin(&a, &b));
  b.crop.width = 0, ck_bad(sf_manifest_same_origin(&a, &b), SF_E_DIFFERENCE, "crop", "whole view"), b = a;
  b.scale = nextafterf(b.scale, 1), ck_bad(sf_manifest_same_origin(&a, &b), SF_E_DIFFERENCE, "scale", "0.8"), b = a;
  b.steps = 3, ck_bad(sf_manifest_same_origin(&a, &b), SF_E_DIFFERENCE, "t_r", "3"), b = a;
  b.model_sha256[0] = 0, ck_bad(sf_manifest_same_origin(&a, &b), SF_E_DIFFERENCE, "model_sha256", "absent");
}

TEST(a_flipped_pixel_is_located)
{
  OWNED(sf_golden) g;
  ck_ok(sf_golden_create(&g, 20, 18, SF_PLANES));
  for (size_t i = 0; i < 20 * 18; i++) sf_golden_int(&g, SF_PLANE_FX_G)[i] = (uint32_t)i * 77;
  sf_golden_real(&g, SF_PLANE_Z)[3] = 5; /* floats are not compared */
  ck_ok(sf_golden_save(&g, in("g.exr"), NULL));
  sf_golden_real(&g, SF_PLANE_Z)[3] = 6;
  ck_ok(sf_golden_compare_file(&g, in("g.exr"), -1));
  sf_golden_int(&g, SF_PLANE_FX_G)[17 * 20 + 11] ^= 1;
  sf_golden_int(&g, SF_PLANE_FX_G)[17 * 20 + 12] ^= 1;
  sf_status status = sf_golden_compare_file(&g, in("g.exr"), -1);
  ck_bad(status, SF_E_DIFFERENCE, "plane fx.G, pixel (11, 17) is 27027, here it is 27026", "g.exr");
  ck_bad(sf_golden_compare_file(&g, in("g.exr"), SF_PLANE_FX_G), SF_E_DIFFERENCE, "(11, 17)", "fx.G");
  ck_ok(sf_golden_compare_file(&g, in("g.exr"), SF_PLANE_FX_R));
  OWNED(sf_golden) small;
  ck_ok(sf_golden_create(&small, 20, 17, SF_PLANES));
  ck_bad(sf_golden_compare_file(&small, in("g.exr"), -1), SF_E_DIFFERENCE, "20 x 18", "20 x 17");
  small.planes = SF_FLOAT_PLANES;
  ck_ok(sf_golden_save(&small, in("f.exr"), NULL));
  small.planes = SF_PLANES;
  ck_bad(sf_golden_compare_file(&small, in("f.exr"), -1), SF_E_DIFFERENCE, "no integer channel spikes", "f.exr");
}

/* The header of an EXR is plain text. */
TEST(the_file_says_what_its_distances_are)
{
  OWNED(sf_golden) g = some_golden();
  for (int ndc = 0; ndc < 2; ndc++) {
    const sf_golden_label label = {
        .net = &net, .scene_sha256 = "0", .view = "a", .split = "test", .downscale = 1, .ndc = ndc};
    size_t size;
    ck_ok(sf_golden_save_labelled(&g, in("labelled.exr"), &label));
    char *bytes = read_whole(in("labelled.exr"), &size);
    ck_assert_int_eq(memmem(bytes, size, "world units of the data set", 27) != NULL, !ndc);
    ck_assert_int_eq(memmem(bytes, size, "NDC units from the rays' origins", 31) != NULL, ndc);
    free(bytes);
  }
}

ck_options ck_program = {.set_up = make_folder, .tear_down = remove_folder};
