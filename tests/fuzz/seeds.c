/* Writes the first inputs of every fuzzing target: small valid files, made by the writers that the programs use.
 * usage: seeds FOLDER */
#include "firmware/sf_blob.h"
#include "firmware/sf_soc.h"
#include "data_set.h"
#include "seed_pictures.h"
#include "sim/board/frame.h"
#include "sim/soc/job.h"
#include "tests/fx_tensorf_fixture.h"
#include "base/io.h"
#include "golden/manifest.h"
#include "quant/quant.h"
#include "sweep/sweep.h"
#include "train/train.h"
#include <elf.h>

/* ---- texts ---- */

static const char one_frame[] =
    "{\"camera_angle_x\": 0.69, \"frames\": [{\"file_path\": \"./a\", \"transform_matrix\":\n"
    "[[1,0,0,0.5],[0,1,0,-1],[0,0,1,4.0],[0,0,0,1]]}, {\"file_path\": \"a.png\", \"rotation\": 0.01,\n"
    "\"transform_matrix\": [[0,-2,0,0],[2,0,0,0],[0,0,2,4],[0,0,0,1]]}]}\n";
static const char many_fields[] =
    "{\"fl_x\": 5, \"fl_y\": 5.5, \"cx\": 2, \"cy\": 1.5, \"w\": 4, \"h\": 3, \"k1\": 0, \"p2\": 0,\n"
    "\"camera_model\": \"OPENCV\", \"is_fisheye\": false, \"frames\": [{\"file_path\": \"../c.png\", \"w\": 4, \"h\": "
    "3,\n"
    "\"camera_angle_y\": 0.5, \"transform_matrix\": [[1,0,0,0],[0,1,0,0],[0,0,1,1e3],[0,0,0,1.0]]},\n"
    "{\"file_path\": \"b.png\", \"w\": 8, \"h\": 6, \"transform_matrix\": "
    "[[1,0,0,0],[0,0,1,0],[0,-1,0,0],[0,0,0,1]]}]}\n";
static const char report_text[] =
    "{\"psnr\": 31.9, \"ssim\": 0.95, \"T\": 8, \"t_r\": 2, \"t_star\": 1.8, \"seconds\": 900, \"samples\": 1000,\n"
    "\"prefix_psnr\": [20, 30, 31], \"crop\": [0, 0, 800, 800], \"energy_fj\": 72.5, \"energy_spiking_fj\": 72.5,\n"
    "\"energy_ann_fj\": 189.5, \"core_equals_recount\": true, \"core_equals_rtl_equals_recount\": false,\n"
    "\"iteration\": 7, \"model\": \"m.safetensors\"}\n";
static const char report_parts[] =
    "{\"backbone\": \"ingp\", \"layout\": \"blender\", \"psnr\": 30, \"ssim\": 0.9, \"t_r\": 3, \"t_star\": 2.6,\n"
    "\"seconds\": 60, \"prefix_psnr\": [20, 25, 30], \"samples\": 500, \"differences\": 0, \"energy_spiking_fj\": "
    "5e13,\n"
    "\"energy_ann_fj\": 1e14, \"energy_fj\": 5e13}\034done\034{\"samples\": 9, \"differences\": 2}\034{\"psnr\": "
    "33.5,\n"
    "\"ssim\": 0.97, \"t_r\": 2, \"seconds\": 9, \"energy_spiking_fj\": 4e13, \"energy_ann_fj\": "
    "2e14}\034{\"iteration\":\n"
    "3}\034{\"psnr\": 31}\034stopped";
static const char report_lines[] = "{\"iteration\": 1, \"t_star\": 8}\n{\"iteration\": 3, \"t_star\": 7.5}\n"
                                   "{\"iteration\": 2, \"t_star\": 7}\n{\"iteration\": 4, \"t_st";

static void put_texts(void)
{
  put_text("dataset", "frames.json", one_frame);
  put_text("dataset", "fields.json", many_fields);
  put_text("report", "run.json", report_text);
  put_text("report", "log.jsonl", report_lines);
  put_text("report", "parts", report_parts);
  put_text("json", "report.json", report_text);
  put_text("json", "frames.json", one_frame);
  put_text("json", "escapes.json", "[\"\\u00e9\\ud83d\\ude00\\n\", -1.5e-3, null, {\"\": {}}]");
  put_text("cli", "all", "scene.snn\n--json\n-v\n3\n--seed=0xff\n--beta\n5e-7\n-oout.exr\n--mode=two\n--\n-x");
}

/* ---- models ---- */

static sf_train_options small_run(void)
{
  sf_train_options options = sf_train_defaults();
  sf_config *config = &options.config;
  config->levels = 1, config->log2_hash = 4, config->base_res = 2, config->finest_res = 2;
  config->hidden = 16, config->steps = 3, config->lattice = 16, config->occ_res = 8;
  options.samples = 256;
  return options;
}

static void put_models(void)
{
  static uint16_t pixel[2 * 2 * 4];
  sf_view view = {.name = "view",
                  .camera = {.width = 2,
                             .height = 2,
                             .fx = 3,
                             .fy = 3,
                             .cx = 1,
                             .cy = 1,
                             .to_world = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 2.5f}},
                  .image = {2, 2, pixel}};
  const sf_dataset data = {.path = "data", .view = &view, .count = 1, .scale = 0.8f};
  const sf_train_options options = small_run();
  sf_train_stats stats;
  sf_trainer *trainer;
  fx_scene scene;
  FUZZ_EXPECT(fuzz_good(sf_trainer_create(&trainer, &data, &options, NULL)));
  FUZZ_EXPECT(fuzz_good(sf_trainer_step(trainer, &stats)));
  FUZZ_EXPECT(fuzz_good(sf_trainer_save(trainer, seed_path("model", "model.safetensors"), false)));
  FUZZ_EXPECT(fuzz_good(sf_trainer_save(trainer, seed_path("checkpoint", "run.safetensors"), true)));
  FUZZ_EXPECT(fuzz_good(sf_quantise(&scene, sf_trainer_model(trainer), "seed", &(sf_quant_options){0})));
  FUZZ_EXPECT(fuzz_good(fx_scene_save(&scene, seed_path("snn", "exported.snn"))));
  fx_scene_free(&scene);
  sf_trainer_free(trainer);
}

static void put_word(uint8_t *block, uint32_t index, int32_t value)
{
  for (int i = 0; i < 4; i++) block[index * 4 + (uint32_t)i] = (uint8_t)((uint32_t)value >> (8 * i));
}

/* The layout of sf_blob.h, with as few inputs as the net has. */
static void put_blob(const fx_net *net)
{
  uint8_t block[SF_BLOB_WORDS * 4 + SF_LAYERS * SF_LANES * SF_LANES] = {0};
  uint32_t at = SF_BLOB_WORDS * 4;
  for (uint32_t l = 0; l < SF_LAYERS; l++) {
    const fx_layer *layer = &net->layer[l];
    const int32_t field[] = {layer->n_in, layer->n_out, layer->k, layer->theta};
    for (uint32_t i = 0; i < 4; i++) put_word(block, SF_BLOB_HEADER_WORDS + 4 * l + i, field[i]);
    memcpy(block + at, layer->w, (size_t)layer->n_in * SF_LANES);
    at += (uint32_t)layer->n_in * SF_LANES;
  }
  const int32_t head[] = {SF_BLOB_MAGIC, SF_BLOB_VERSION, (int32_t)at, net->mode, net->steps, 1, 2, 3, 4, 5, 6};
  for (uint32_t i = 0; i < SF_BLOB_HEADER_WORDS; i++) put_word(block, i, head[i]);
  put("blob", "small", block, at);
}

static void put_tile(const fx_scene *scene)
{
  const fx_ray rays[2] = {{.count = 3, .step = {1 << 20, 1 << 21, 1 << 22}}};
  uint8_t *image;
  size_t size;
  FUZZ_EXPECT(fuzz_good(sf_soc_image_make(scene, rays, 2, 1, &image, &size)));
  put("tile", "small", image, size);
  free(image);
}

/* scene: what is not in the sizes. */
static void put_scene(fx_scene scene, const char *name, const fixture_sizes *sizes, uint64_t seed)
{
  fixture_set_sizes(&scene, sizes);
  FUZZ_EXPECT(fuzz_good(fx_scene_allocate(&scene, name)));
  fixture_fill(&scene, sizes, seed);
  FUZZ_EXPECT(fuzz_good(fx_scene_save(&scene, seed_path("snn", name))));
  if (seed == 1) put_blob(&scene.net), put_tile(&scene);
  fx_scene_free(&scene);
}

static void put_scenes(void)
{
  /* step_q24 is the one that fixture_fill sets later: the table of steps is made before */
  const fx_scene unbounded = {
      .log2_bound = 2, .step_q24 = 30000, .gamma_q24 = 1 << 18, .near_q16 = 3 << 16, .longest_q16 = 9 << 16};
  fx_scene factors = tensorf_scene();
  put_scene((fx_scene){0}, "small.snn", &(fixture_sizes){1, 1, 2, 1, 1, 2, 2, FX_HYBRID, {0}}, 1);
  put_scene((fx_scene){0}, "hashed.snn", &(fixture_sizes){5, 3, 3, 2, 5, 4, 3, FX_NODECAY, {0}}, 2);
  put_scene((fx_scene){0}, "radix.snn", &(fixture_sizes){2, 4, 3, 2, 4, 3, 4, FX_RADIX, {0}}, 4);
  put_scene(unbounded, "unbounded.snn", &(fixture_sizes){2, 3, 3, 2, 5, 4, 2, FX_DECAY, {0, 0, 900, 1, 1}}, 3);
  FUZZ_EXPECT(fuzz_good(fx_scene_save(&factors, seed_path("snn", "tensorf.snn"))));
  fx_scene_free(&factors);
}

static void put_manifest(bool is_float)
{
  sf_manifest manifest = {.total = 2};
  sf_manifest_view view = {
      .name = "test/r_0", .width = 3, .height = 2, .samples = 9, .rays = 6, .psnr = 31.5, .ssim = 0.9};
  manifest.origin =
      (sf_manifest_origin){.split = "test", .steps = 2, .downscale = 1, .scale = 0.8f, .crop = {1, 2, 3, 2}};
  memset(manifest.origin.scene_sha256, 'a', 64);
  memset(view.camera_sha256, 'b', 64);
  memset(view.exr_sha256, 'c', 64);
  strcpy(view.exr, "view_0000.exr");
  if (is_float) {
    memset(manifest.origin.model_sha256, 'd', 64);
  } else {
    for (int p = 0; p < SF_PLANES; p++)
      if (sf_plane_is_integer((sf_plane)p)) memset(view.plane_sha256[p], 'e', 64);
    for (int e = 0; e < SF_EVENTS; e++) view.event[e] = (uint64_t)e * 10;
    memset(view.counts_sha256, 'f', 64);
    strcpy(view.unexpected_saturation, "none");
  }
  FUZZ_EXPECT(fuzz_good(sf_manifest_put(&manifest, &view)));
  FUZZ_EXPECT(fuzz_good(sf_manifest_save(&manifest, seed_path("manifest", is_float ? "float.json" : "fixed.json"))));
  sf_manifest_free(&manifest);
}

static void put_tensors(void)
{
  float real[6] = {0, 1, -2, 3.5f, 1e30f, -0.0f};
  int8_t byte[3] = {1, -2, 3};
  int64_t wide[1] = {-5};
  const sf_tensor tensor[] = {{"real", SF_F32, 2, {2, 3}, real},
                              {"byte", SF_I8, 1, {3}, byte},
                              {"wide", SF_I64, 0, {0}, wide},
                              {"none", SF_U8, 2, {0, 7}, byte}};
  cJSON *metadata = cJSON_CreateObject();
  FUZZ_EXPECT(cJSON_AddStringToObject(metadata, "format", "seed"));
  FUZZ_EXPECT(fuzz_good(sf_tensors_save(tensor, 4, metadata, seed_path("tensors", "four.safetensors"))));
  FUZZ_EXPECT(fuzz_good(sf_tensors_save(tensor, 0, NULL, seed_path("tensors", "empty.safetensors"))));
  cJSON_Delete(metadata);
}

/* For fuzz_colmap: the number of the table in front. */
static void put_table(const layout_file *file, int kind)
{
  uint8_t bytes[LAYOUT_BYTES + 1] = {(uint8_t)kind};
  char name[20];
  memcpy(bytes + 1, file->bytes, file->size);
  snprintf(name, sizeof name, "table%d", kind);
  put("colmap", name, bytes, file->size + 1);
}

static void put_requests(void)
{
  put_text(
      "view", "picture",
      "camera=20,10,25.5,25.5,10,5,1,0,0,0,0,1,0,0,0,0,1,4,0.1,0,1e-05,0\nsteps=4\nsource=fixed\nstride=3\nfinish=1\n"
      "map=spikes-c1\n 127.0.0.1:8323 http://127.0.0.1:8323\n");
  put_text("view", "pixel", "view=3\nx=7\ny=9\nsample=2\nlayer=1\nneuron=5\nwindow=1,2,3,4\nkind=exr\n [::1]:80 x");
}

static void put_layouts(void)
{
  static layout_file file;
  const layout_rig rig = layout_small_rig();
  for (int text = 0; text < 2; text++) {
    layout_cameras(&file, &rig, text), put_table(&file, 3 * text);
    layout_images(&file, &rig, text), put_table(&file, 3 * text + 1);
    layout_points(&file, &rig, text), put_table(&file, 3 * text + 2);
  }
  for (int single = 0; single < 2; single++) {
    layout_npy(&file, &rig, single, 2, 9);
    put("llff", single ? "single.npy" : "double.npy", file.bytes, file.size);
  }
  put_text(
      "dataset", "ngp.json",
      "{\"fl_x\":5,\"fl_y\":5,\"cx\":2,\"cy\":1.5,\"w\":4,\"h\":3,\"k1\":0.05,\"k2\":-0.01,\"p1\":0.001,\"p2\":0.002,"
      "\"aabb_scale\":4,\"scale\":0.3,\"offset\":[0.5,0.5,0.5],\"frames\":["
      "{\"file_path\":\"a.png\",\"transform_matrix\":[[1,0,0,0],[0,1,0,0],[0,0,1,3],[0,0,0,1]]},"
      "{\"file_path\":\"a.png\",\"transform_matrix\":[[1,0,0,1],[0,1,0,0],[0,0,1,3],[0,0,0,1]]}]}");
}

/* A program of one word, and memory behind it. */
static void put_elf(void)
{
  struct {
    Elf32_Ehdr head;
    Elf32_Phdr segment;
    uint32_t word;
  } file = {.head = {.e_ident = ELFMAG,
                     .e_type = ET_EXEC,
                     .e_machine = EM_RISCV,
                     .e_version = EV_CURRENT,
                     .e_entry = SF_SOC_RAM,
                     .e_phoff = sizeof(Elf32_Ehdr),
                     .e_ehsize = sizeof(Elf32_Ehdr),
                     .e_phentsize = sizeof(Elf32_Phdr),
                     .e_phnum = 1},
            .segment = {.p_type = PT_LOAD,
                        .p_offset = sizeof(Elf32_Ehdr) + sizeof(Elf32_Phdr),
                        .p_paddr = SF_SOC_RAM,
                        .p_filesz = 4,
                        .p_memsz = 64},
            .word = 0x0000006f};
  file.head.e_ident[EI_CLASS] = ELFCLASS32, file.head.e_ident[EI_DATA] = ELFDATA2LSB;
  put("elf", "loop", &file, sizeof file);
}

static void put_frames(void)
{
  static const sf_frame frame[] = {{.number = 1, .command = 0x81, .words = 2, .word = {0x5346, 1}},
                                   {.number = 2, .command = 0xee, .words = 1, .word = {0xdbc0}}};
  uint8_t line[SF_FRAME_BYTES];
  for (int i = 0; i < 2; i++) put("frame", i ? "refusal" : "answer", line, sf_frame_write(&frame[i], line));
}

static void put_technologies(void)
{
  put_text("technology", "small.tech",
           "# prices\nname x\ntitle X, 1 V\nfp32_mac 4.6 pJ a\nfp32_add 0.9 pJ a\nint_add.8 0.03 pJ a\n"
           "int_add.32 0.1 pJ a\nint_multiply.8 0.2 pJ a\nint_multiply.32 3.1 pJ a\nsram.8192 10 pJ a\n"
           "sram.32768 20 pJ a\ndram 1.95 nJ a\nregister 1 pJ a\ntag_lookup 7 fJ a\n");
  char text[4000]; /* as many prices as there may be */
  int n = snprintf(text, sizeof text,
                   "name x\ntitle X, 1 V\nfp32_mac 4.6 pJ a\nfp32_add 0.9 pJ a\nint_add.8 0.03 pJ a\n"
                   "int_add.32 0.1 pJ a\nint_multiply.8 0.2 pJ a\nint_multiply.32 3.1 pJ a\n"
                   "dram 1.95 nJ a\nregister 1 pJ a\ntag_lookup 7 fJ a\n");
  for (int i = 9; i < SF_PRICES_MAX; i++)
    n += snprintf(text + n, sizeof text - (size_t)n, "sram.%d %d pJ a\n", 1024 * i, i);
  put_text("technology", "full.tech", text);
}

/* Two points, by their own writer. */
static void put_sweep(void)
{
  sf_point point = {.name = "w8-t2", .model = "m.safetensors", .steps_max = 4};
  for (int i = 0; i < SF_POINT_FIGURES; i++) point.figure[i] = 10 + i;
  cJSON *json = sf_point_json(&point);
  char *text = json ? cJSON_PrintUnformatted(json) : NULL, both[8192];
  FUZZ_EXPECT(text);
  snprintf(both, sizeof both, "%s\034%s", text, text);
  put_text("sweep", "one", text);
  put_text("sweep", "two", both);
  free(text);
  cJSON_Delete(json);
}

int main(int argc, char **argv)
{
  if (argc != 2) return fprintf(stderr, "usage: seeds FOLDER\n"), 2;
  seed_root = argv[1];
  put_pictures();
  put_exr();
  put_texts();
  put_requests();
  put_manifest(false);
  put_manifest(true);
  put_tensors();
  put_models();
  put_scenes();
  put_layouts();
  put_elf();
  put_frames();
  put_technologies();
  put_sweep();
  return 0;
}
