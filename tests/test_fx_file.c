/* Scene files: round trip, and every kind of damage refused with a message that names file and place. */
#include "ck_run.h"
#include "base/io.h"
#include "scene_file_fixture.h"
#include "tests/fx_tensorf_fixture.h"

static fx_scene small_scene(uint64_t seed)
{
  const fixture_sizes sizes = {2, 16, 5, 9, 24, 40, 3, FX_NODECAY, {0}};
  return fixture_scene(&sizes, seed);
}

static void save(const fx_scene *scene)
{
  ck_ok(fx_scene_save(scene, path));
}

static void assert_equal_scenes(const fx_scene *a, const fx_scene *b)
{
  for (int l = 0; l < SF_LAYERS; l++) {
    const fx_layer *x = &a->net.layer[l], *y = &b->net.layer[l];
    ck_assert(x->n_in == y->n_in && x->n_out == y->n_out && x->k == y->k && x->theta == y->theta);
    ck_assert_int_eq(x->bias, y->bias);
    ck_assert_mem_eq(x->w, y->w, (size_t)fx_layer_rows(x) * SF_LANES);
    ck_assert(a->units.current_scale[l] == b->units.current_scale[l]);
  }
  ck_assert(a->net.mode == b->net.mode && a->net.steps == b->net.steps);
  ck_assert_mem_eq(&a->net.exp_in, &b->net.exp_in, sizeof a->net.exp_in);
  ck_assert_mem_eq(&a->net.sigmoid_in, &b->net.sigmoid_in, sizeof a->net.sigmoid_in);
  ck_assert_mem_eq(&a->grid, &b->grid, offsetof(fx_grid, table));
  ck_assert_mem_eq(a->grid.table, b->grid.table, (size_t)a->grid.entries * 2);
  ck_assert_int_eq(a->occ_res, b->occ_res);
  ck_assert_mem_eq(a->occupancy, b->occupancy, 64);
  ck_assert(a->step_q24 == b->step_q24 && a->max_samples == b->max_samples && a->trans_stop == b->trans_stop);
  ck_assert_mem_eq(a->background, b->background, sizeof a->background);
  ck_assert(a->units.model_scale == b->units.model_scale && a->units.data_scale == b->units.data_scale);
  ck_assert(a->units.data_bound == b->units.data_bound && a->units.data_ndc == b->units.data_ndc);
  ck_assert(a->units.data_views == b->units.data_views && a->units.data_poses == b->units.data_poses);
  ck_assert(a->units.data_picture == b->units.data_picture);
  ck_assert(a->units.to_box_scale == b->units.to_box_scale && a->units.dir_scale == b->units.dir_scale);
  for (int l = 0; l < FX_LEVELS_MAX; l++) ck_assert(a->units.feature_scale[l] == b->units.feature_scale[l]);
  for (int o = 0; o < 3; o++) ck_assert(a->units.to_box_offset[o] == b->units.to_box_offset[o]);
}

TEST(round_trip)
{
  for (uint64_t seed = 0; seed < 20; seed++) {
    const fixture_sizes sizes = fixture_random_sizes(seed);
    OWNED(fx_scene) scene = fixture_scene(&sizes, seed), again;
    scene.units.to_box_scale = 1.0 / 3, scene.units.dir_scale = 0x1p-11, scene.units.to_box_offset[1] = -1e6 / 7;
    scene.background[2] = 12345, scene.units.model_scale = seed % 2 ? 0.4 : 0;
    scene.units.data_scale = seed % 3 ? 0.3 : 0, scene.units.data_bound = seed % 3 ? 4 : 0;
    scene.units.data_ndc = seed % 3 == 2;
    scene.units.data_views = seed % 2 ? 60 : 0, scene.units.data_poses = seed % 2 ? 987654321 : 0;
    scene.units.data_picture = seed % 2 ? 123456789 : 0;
    save(&scene);
    ck_ok(fx_scene_load(&again, path));
    assert_equal_scenes(&scene, &again);
    ck_assert_int_eq(entries(), 1);
  }
}

TEST(same_scene_same_bytes)
{
  OWNED(fx_scene) scene = small_scene(1);
  save(&scene);
  ck_ok(fx_scene_save(&scene, in("again")));
  ck_assert(same_files(path, in("again")));
}

TEST(cut_short_anywhere)
{
  size_t size;
  fx_scene again;
  OWNED(fx_scene) scene = small_scene(2);
  save(&scene);
  char *data = read_whole(path, &size);
  for (size_t keep = 0; keep < size; keep += keep < 4000 ? 13 : 997) {
    put_file(path, data, keep);
    const sf_status status = fx_scene_load(&again, path);
    ck_assert_msg(status.code != SF_OK && strstr(status.message, path), "%zu of %zu bytes load", keep, size);
  }
  free(data);
}

/* Any changed byte of the data, and any changed byte of the header, is refused. */
TEST(edited_anywhere)
{
  size_t size;
  fx_scene again;
  OWNED(fx_scene) scene = small_scene(3);
  save(&scene);
  char *data = read_whole(path, &size);
  for (uint64_t i = 0; i < 1500; i++) {
    const size_t at =
        i < 700 ? (size_t)fixture_pick(1, 0, i, 0, 3500) : (size_t)fixture_pick(1, 1, i, 0, (int64_t)size - 1);
    const char kept = data[at];
    data[at] = (char)(kept ^ (1 << fixture_pick(1, 2, i, 0, 7)));
    put_file(path, data, size);
    const sf_status status = fx_scene_load(&again, path);
    if (status.code == SF_OK) { /* only white space of the header's JSON may differ */
      assert_equal_scenes(&scene, &again);
      ck_assert_msg(at >= 8 && (kept == ' ' || data[at] == ' '), "byte %zu: %02x for %02x loads", at, data[at], kept);
      fx_scene_free(&again);
    }
    data[at] = kept;
  }
  free(data);
}

TEST(metadata_is_checked)
{
  static const char *const wrong[][3] = {
      {"format", "spikefield-model", "format"},
      {"format", NULL, "format"},
      {"version", "2", "version"},
      {"version", NULL, "version"},
      {"arch", "AC_FRAC=4 LEAK_FRAC=12 H_SHIFT=3 INPUT_BITS=12 LOG_FRAC=12 TRANS_FRAC=20 DELTA_FRAC=24", "arch"},
      {"arch", NULL, "arch"},
      {"t_r", "0", "t_r"},
      {"t_r", "9", "t_r"},
      {"t_r", "-1", "t_r"},
      {"t_r", "3x", "t_r"},
      {"t_r", "", "t_r"},
      {"t_r", NULL, "t_r"},
      {"t_r", "99999999999999999999", "t_r"},
      {"t_r", "2", "checksum"},
      {"checksum", NULL, "checksum"},
      {"checksum", "0x0", "checksum"},
      {"mode", "soft", "mode"},
      {"D1.k", "4097", "D1.k"},
      {"C1.k", "-1", "C1.k"},
      {"D1.theta", "0", "D1.theta"},
      {"C2.theta", "8388608", "C2.theta"},
      {"D2.theta", "1", "D2.theta"},
      {"D1.n_out", "129", "D1.n_out"},
      {"D1.n_out", "15", "D2.n_in"},
      {"C3.n_out", "4", "C3.n_out"},
      {"C1.n_in", "33", "C1.n_in"},
      {"grid.levels", "17", "grid.levels"},
      {"grid.levels", "1", "grid.scale_q16"},
      {"exp_in.mul", "65536", "exp_in.mul"},
      {"exp_in.shift", "32", "exp_in.shift"},
      {"exp_in.bias", "131072", "exp_in.bias"},
      {"sigmoid_in.bias", "1", "sigmoid_in.bias"},
      {"occ_res", "12", "occ_res"},
      {"occ_res", "512", "occ_res"},
      {"step_q24", "0", "step_q24"},
      {"max_samples", "1025", "max_samples"},
      {"trans_stop", "1048576", "trans_stop"},
      {"background[1]", "65537", "background[1]"},
      {"dir_scale", "nan", "dir_scale"},
      {"dir_scale", "0", "dir_scale"},
      {"dir_scale", "0x1p-12", "dir_scale"},
      {"dir_scale", "2", "dir_scale"},
      {"dir_scale", "0x1.8p-7", "dir_scale"},
      {"to_box_offset[2]", "inf", "to_box_offset[2]"},
      {"to_box_scale", "one", "to_box_scale"},
      {"model_scale", "0", "model_scale"},
      {"model_scale", "-1", "model_scale"},
      {"model_scale", "inf", "model_scale"},
      {"model_scale", "1", "checksum"},
      {"data_scale", "0", "data_scale"},
      {"data_ndc", "nan", "data_ndc"},
      {"data_poses", "-1", "data_poses"},
      {"data_picture", "0", "data_picture"},
  };
  OWNED(fx_scene) scene = small_scene(4);
  for (int i = 0; i < COUNT(wrong); i++) assert_edit_refused(&scene, wrong[i]);
}

/* The mode of that name was another neuron. */
TEST(scenes_of_weighted_spikes_are_refused)
{
  OWNED(fx_scene) scene = small_scene(4);
  fx_scene loaded;
  save(&scene);
  edit("mode", "weighted");
  const sf_status status = fx_scene_load(&loaded, path);
  ck_assert_int_eq(status.code, SF_E_UNSUPPORTED);
  ck_assert_ptr_nonnull(strstr(status.message, "train the model anew"));
}

TEST(thresholds_of_radix_end_earlier)
{
  OWNED(fx_scene) scene = small_scene(5);
  const int32_t highest = (1 << 22) - 1;
  for (int mode = FX_HYBRID; mode <= FX_RADIX; mode++)
    for (int s = 0; s < FX_SPIKING; s++) {
      fx_layer *layer = &scene.net.layer[fx_spiking_layers[s]];
      const int32_t kept = layer->theta;
      scene.net.mode = mode;
      layer->theta = highest;
      ck_ok(fx_scene_check(&scene, "scene"));
      layer->theta = highest + 1;
      const sf_status status = fx_scene_check(&scene, "scene");
      ck_assert_int_eq(status.code, mode == FX_RADIX ? SF_E_RANGE : SF_OK);
      if (mode == FX_RADIX) ck_assert_ptr_nonnull(strstr(status.message, "theta is 4194304, expected 1..4194303"));
      layer->theta = kept;
    }
}

/* The one parameter that is another, and nothing else of the seven. */
TEST(another_arch_names_its_parameter)
{
  char arch[200], wanted[200];
  OWNED(fx_scene) scene = small_scene(4);
  save(&scene);
  snprintf(arch, sizeof arch, "AC_FRAC=%d LEAK_FRAC=%d H_SHIFT=%d", SF_AC_FRAC, SF_LEAK_FRAC + 1, SF_H_SHIFT);
  snprintf(wanted, sizeof wanted, "metadata 'arch': the scene has LEAK_FRAC=%d, this build LEAK_FRAC=%d",
           SF_LEAK_FRAC + 1, SF_LEAK_FRAC);
  edit("arch", arch);
  fx_scene loaded;
  const sf_status status = fx_scene_load(&loaded, path);
  ck_assert_int_eq(status.code, SF_E_UNSUPPORTED);
  ck_assert_uint_ge(strlen(status.message), strlen(wanted));
  ck_assert_str_eq(status.message + strlen(status.message) - strlen(wanted), wanted); /* the line ends there */
}

/* With the default H_SHIFT every h fits; a build with a smaller one refuses what the 12 bits of h do not hold. */
TEST(largest_h_must_fit)
{
  const fixture_sizes sizes = {2, SF_LANES, 5, 9, 24, 40, 3, FX_NODECAY, {0}};
  OWNED(fx_scene) scene = fixture_scene(&sizes, 4);
  fx_layer *d2 = &scene.net.layer[FX_D2];
  for (int sign = -1; sign <= 1; sign += 2) {
    for (int i = 0; i < d2->n_in; i++) d2->w[i * SF_LANES] = 127, d2->w[i * SF_LANES + 1] = (int8_t)(sign * 127);
    const int most = (d2->n_in * 127) >> SF_H_SHIFT;
    ck_assert_int_eq(fx_largest_h(d2), most);
    ck_assert_int_eq(fx_scene_check(&scene, "here").code, most < 2048 ? SF_OK : SF_E_RANGE);
  }
}

/* Such a file passes every check of the nets, and no rule of its sizes says what its grid may be. */
TEST(decoder_behind_a_grid_is_refused)
{
  static const char *const none[] = {"D1.n_in", "D1.n_out", "D1.theta", "D2.n_in", "D2.n_out"};
  OWNED(fx_scene) scene = small_scene(9);
  save(&scene);
  for (size_t i = 0; i < sizeof none / sizeof *none; i++) edit(none[i], "0");
  assert_refused("grid.levels is 2, expected 0..0");
}

/* They would size what is listed level by level. */
TEST(levels_of_a_scene_without_a_grid_are_refused)
{
  OWNED(fx_scene) scene = tensorf_scene();
  save(&scene);
  edit("grid.levels", "17");
  assert_refused("grid.levels is 17, expected 0..0");
}

/* Rewrites with one tensor's first element changed. */
static void edit_tensor(const char *name, int64_t value)
{
  OWNED(sf_tensors) set;
  ck_ok(sf_tensors_load(&set, path));
  for (int i = 0; i < set.count; i++) {
    if (strcmp(set.tensor[i].name, name)) continue;
    memcpy(set.tensor[i].data, &value, sf_dtype_size(set.tensor[i].type));
  }
  ck_ok(sf_tensors_save(set.tensor, set.count, set.metadata, path));
}

TEST(tensors_are_checked)
{
  static const struct {
    const char *tensor;
    int64_t value;
    const char *place;
  } wrong[] = {{"density.w1", -128, "density.w1"}, {"grid.stride", 3, "stride"},          {"grid.stride", -1, "stride"},
               {"grid.stride", 601, "stride"},     {"grid.offset", 1, "offset"},          {"grid.shift", 32, "shift"},
               {"grid.scale_q16", 0, "scale_q16"}, {"grid.scale_q16", 1 << 30, "stride"}, {"colour.w5", 1, "checksum"},
               {"occupancy", 77, "checksum"},      {"grid.table", 1, "checksum"}};
  OWNED(fx_scene) scene = small_scene(5);
  scene.grid.table[0] = 0, scene.occupancy[0] = 0, scene.net.layer[FX_C3].w[0] = 0;
  for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
    save(&scene);
    edit_tensor(wrong[i].tensor, wrong[i].value);
    assert_refused(wrong[i].place);
  }
}

TEST(missing_tensor_is_named)
{
  static const char *const names[] = {"grid.table", "occupancy", "density.w1",  "density.w2", "colour.w3",
                                      "colour.w4",  "colour.w5", "grid.offset", "grid.shift"};
  OWNED(fx_scene) scene = small_scene(6);
  for (size_t n = 0; n < sizeof names / sizeof *names; n++) {
    sf_tensors set;
    save(&scene);
    ck_ok(sf_tensors_load(&set, path));
    int kept = 0;
    for (int i = 0; i < set.count; i++)
      if (strcmp(set.tensor[i].name, names[n])) set.tensor[kept++] = set.tensor[i];
    ck_assert_int_eq(kept, set.count - 1);
    ck_ok(sf_tensors_save(set.tensor, kept, set.metadata, path));
    sf_tensors_free(&set);
    assert_refused(names[n]);
  }
}

TEST(lanes_beyond_the_layer_are_zero)
{
  OWNED(fx_scene) scene = small_scene(7);
  scene.net.layer[FX_C1].w[24] = 1;
  ck_bad(fx_scene_check(&scene, "memory"), SF_E_RANGE, "colour.w3", "");
}

TEST(a_decoder_alone_is_no_file)
{
  OWNED(fx_scene) scene = fixture_scene(&fixture_decoder, 9);
  ck_bad(fx_scene_save(&scene, path), SF_E_UNSUPPORTED, path, "decoder");
  ck_assert_int_eq(entries(), 0);
}

TEST(unwritable_and_missing)
{
  OWNED(fx_scene) scene = small_scene(8);
  snprintf(path, sizeof path, "%s/absent/scene.snn", folder);
  ck_assert_int_eq(fx_scene_save(&scene, path).code, SF_E_IO);
  assert_refused("absent");
  scene.net.steps = 0;
  snprintf(path, sizeof path, "%s/scene.snn", folder);
  ck_assert_int_eq(fx_scene_save(&scene, path).code, SF_E_RANGE);
  ck_assert_int_eq(entries(), 0);
}

int ck_timeout = 300;
ck_options ck_program = {.set_up = set_up, .tear_down = remove_folder};
