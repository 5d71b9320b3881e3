/* The HTML report: well-formed, nothing fetched, every figure there with its data, every number the JSON's; and a page
 * with a planted fault is caught. */
#include "ck_run.h"
#include "folder_fixture.h"
#include "page/page.h"
#include "base/io.h"
#include "tests/fx_tensorf_fixture.h"
#include "tests/html_judge.h"

typedef struct fixture {
  fx_scene scene;
  sf_dataset data;
  sf_view view;
  sf_audit_report report;
  sf_page page;
  char *text;
} fixture;

enum { WIDTH = 20, HEIGHT = 12 };

static const char technology[] =
    "name plain\ntitle A plain technology\nfp32_mac 4.6 pJ a <source> & more\n"
    "fp32_add 0.9 pJ s\nint_add.8 0.03 pJ s\nint_add.32 0.1 pJ s\nint_multiply.8 0.2 pJ s\n"
    "int_multiply.32 3.1 pJ s\nsram.8192 10 pJ s\nsram.1048576 100 pJ s\ndram 1.95 nJ s\n";

static sf_status make_ray(void *user, uint64_t index, fx_ray *ray)
{
  const fixture *f = user;
  return sf_pixel_ray(&f->scene, &f->data, &f->view, (int)(index % WIDTH), (int)(index / WIDTH), ray);
}

static void make_view(fixture *f, bool picture)
{
  const float pose[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 3};
  snprintf(f->view.name, sizeof f->view.name, "test/r_<0>");
  f->view.camera =
      (sf_camera){.width = WIDTH, .height = HEIGHT, .fx = 20, .fy = 20, .cx = WIDTH / 2.0f, .cy = HEIGHT / 2.0f};
  memcpy(f->view.camera.to_world, pose, sizeof pose);
  f->data.view = &f->view, f->data.count = f->data.total = 1, f->data.scale = 0.8f, f->data.bound = 1;
  if (!picture) return;
  f->view.image = (sf_image){WIDTH, HEIGHT, malloc(sizeof(uint16_t) * 4 * WIDTH * HEIGHT)};
  for (int i = 0; i < 4 * WIDTH * HEIGHT; i++)
    f->view.image.rgba[i] = (uint16_t)fixture_pick(9, 1, (uint64_t)i, 0, 65535);
}

static void make_report(fixture *f)
{
  sf_audit_report *r = &f->report;
  sf_technology tech;
  ck_ok(sf_write_file(in("plain.tech"), technology, sizeof technology - 1));
  ck_ok(sf_technology_load(&tech, in("plain.tech")));
  *r = (sf_audit_report){.scene = "a/scene.snn",
                         .data = "a/da<ta>&\"x\"",
                         .split = "test",
                         .sha256 = "00ff",
                         .net = &f->scene.net,
                         .rays = WIDTH * HEIGHT,
                         .seed = 7,
                         .views = 1};
  const sf_measure_job job = {
      .scene = &f->scene, .rays = r->rays, .ray = make_ray, .user = f, .seed = 7, .check = UINT64_MAX};
  ck_ok(sf_measure_rays(&job, &r->measure));
  ck_ok(sf_ledger_make(&f->scene.net, &r->measure.core, &r->ledger));
  r->traffic = sf_traffic_of(&f->scene, &r->measure.core, &r->measure.memory, r->rays);
  r->cache = sf_cache_built;
  const sf_counted counted = {&f->scene, &r->measure.core, &r->measure.memory, &r->traffic, r->cache};
  ck_ok(sf_ledgers_make(&tech, &counted, &r->ledgers));
  r->three = (sf_three_counts){.rays = (int)r->measure.checked,
                               .rtl_events = SF_TRAFFIC_AT_PORTS,
                               .core = r->measure.checked_core,
                               .rtl = r->measure.checked_core,
                               .recount = r->measure.recount};
}

static void read_page(fixture *f)
{
  size_t size;
  free(f->text);
  ck_ok(sf_page_save(&f->page, in("page.html")));
  f->text = read_whole(in("page.html"), &size);
  ck_assert_uint_eq(strlen(f->text), size);
}

static fixture begin(int steps, bool picture, bool empty)
{
  static const fixture_sizes sizes = {4, 32, 16, 16, 32, 32, 3, FX_HYBRID, {0}};
  fixture f = {0};
  f.scene = fixture_scene(&sizes, 3);
  f.scene.net.steps = steps;
  f.scene.step_q24 = 600000;
  if (empty) memset(f.scene.occupancy, 0, 64);
  make_view(&f, picture);
  return f;
}

/* The fixture holds pointers to itself: this comes once it lies where it stays. */
static void finish(fixture *f)
{
  f->data.view = &f->view;
  make_report(f);
  f->page = (sf_page){.report = &f->report,
                      .scene = &f->scene,
                      .data = &f->data,
                      .view = &f->view,
                      .command = "energy_audit 'a<b' --html x&y",
                      .whole = true};
  ck_ok(sf_page_gather(&f->page));
  read_page(f);
}

static void fixture_free(fixture *f)
{
  free(f->text);
  sf_page_free(&f->page);
  sf_measure_free(&f->report.measure);
  sf_image_free(&f->view.image);
  fx_scene_free(&f->scene);
}

LOOP_TEST(a_page_is_whole, 4)
{
  static const int steps[] = {1, 2, 3, 8};
  OWNED(fixture) f = begin(steps[_i], true, false);
  finish(&f);
  const faults found = judge(f.text, &f.report);
  ck_assert_msg(found.count == 0, "%d faults: %s", found.count, found.first);
  ck_assert_ptr_null(strstr(f.text, "da<ta>"));
  ck_assert_ptr_null(strstr(f.text, "DIFFERENT"));
}

/* A decoder has no density network: its layers, figures and numbers are fewer, and they agree. */
TEST(a_page_of_a_decoder)
{
  OWNED(fixture) f = begin(2, true, false);
  fx_scene_free(&f.scene);
  f.scene = tensorf_scene();
  finish(&f);
  faults found = {0};
  cJSON *json = page_json(f.text);
  check_tags(&found, f.text);
  check_references(&found, f.text);
  check_ledgers(&found, f.text, &f.report.ledgers);
  check_numbers(&found, f.text, json);
  check_element(&found, f.text, "figure", "fig-raster", "<path class=\"tick", 2);
  check_element(&found, f.text, "figure", "fig-rates", "<svg", 2);
  ck_assert_msg(found.count == 0, "%d faults: %s", found.count, found.first);
  ck_assert_ptr_null(strstr(f.text, "fig-readings"));
  ck_assert_ptr_null(strstr(f.text, ">D1<"));
  cJSON_Delete(json);
}

/* The energies per sample, over all samples, are the energy of the view; their map is not that of the samples. */
static void check_maps(const fixture *f)
{
  cJSON *json = sf_page_json(&f->page);
  const double least = sf_json_number(json_at(json, "page.energy_per_sample"), "least_fj");
  const double most = sf_json_number(json_at(json, "page.energy_per_sample"), "most_fj");
  const double mean = sf_json_number(json_at(json, "page.energy_per_sample"), "mean_fj");
  const double fj = (double)f->report.ledger.spiking_fj, samples = (double)f->report.measure.core.samples;
  ck_assert(least > 0 && least < mean && mean < most);
  ck_assert_double_eq_tol(mean * samples, fj, 1e-6 * fj);
  cJSON_Delete(json);
  char *energy = element(f->text, "figure", "fig-energy-map"), *number = element(f->text, "figure", "fig-samples-map");
  ck_assert(energy && number);
  const char *a = strstr(energy, "base64,"), *b = strstr(number, "base64,");
  ck_assert(a && b);
  ck_assert_uint_ne(strcspn(a, "\"") == strcspn(b, "\"") && !strncmp(a, b, strcspn(a, "\"")), 1);
  free(energy), free(number);
}

/* What the pictures and the counts say of the same view is the same. */
TEST(pictures_agree_with_the_audit)
{
  OWNED(fixture) f = begin(2, true, false);
  finish(&f);
  const sf_page *p = &f.page;
  uint64_t samples = 0, spikes = 0, neurons = 0;
  ck_assert_uint_eq(p->prefix[1].fj, f.report.ledger.spiking_fj);
  for (int i = 0; i < WIDTH * HEIGHT; i++) {
    samples += sf_golden_int(&p->golden, SF_PLANE_SAMPLES)[i];
    ck_assert(sf_golden_int(&p->golden, SF_PLANE_SAMPLES)[i] ? p->steps[i] >= 1 && p->steps[i] <= SF_T_MAX
                                                             : p->steps[i] == 0);
  }
  ck_assert_uint_eq(samples, f.report.measure.core.samples);
  ck_assert_uint_eq(p->sampled, samples); /* fewer than are looked at: every one */
  spikes = sf_event_total(&f.report.measure.core, SF_EVENT_SPIKES);
  for (int l = 0; l < SF_LAYERS; l++)
    for (int t = 0; t < SF_T_MAX; t++)
      for (int o = 0; o < SF_LANES; o++) neurons += p->neuron[l][t][o];
  ck_assert_uint_eq(neurons, spikes);
  check_maps(&f);
  ck_assert_int_gt(p->ray.samples, 0);
  ck_assert_uint_eq((unsigned)p->ray.all, sf_golden_int(&p->golden, SF_PLANE_SAMPLES)[p->ray.y * WIDTH + p->ray.x]);
  f.report.measure.core.layer[FX_C2].sop[1]++;
  sf_page_free(&f.page);
  memset(f.page.neuron, 0, sizeof f.page.neuron);
  ck_bad(sf_page_gather(&f.page), SF_E_DIFFERENCE, "C2", "");
}

/* A page without some of its figures: what is there is whole. */
static void check_plain(const char *text)
{
  faults found = {0};
  cJSON *json = page_json(text);
  check_tags(&found, text);
  check_references(&found, text);
  check_numbers(&found, text, json);
  ck_assert_msg(found.count == 0, "%d faults: %s", found.count, found.first);
  ck_assert_ptr_null(strstr(text, "nan"));
  ck_assert_ptr_null(strstr(text, "inf"));
  cJSON_Delete(json);
}

LOOP_TEST(a_view_without_photograph_or_samples, 2)
{
  OWNED(fixture) f = begin(2, _i == 1, _i == 1);
  finish(&f);
  check_plain(f.text);
}

/* PSNR is infinite after one number of steps, then after all. */
TEST(pictures_equal_to_the_photograph)
{
  OWNED(fixture) f = begin(2, true, false);
  finish(&f);
  for (int all = 0; all < 2; all++) {
    for (int t = all ? 0 : 2; t < (all ? SF_T_MAX : 3); t++) f.page.prefix[t].psnr = INFINITY;
    read_page(&f);
    check_plain(f.text);
    ck_assert_ptr_null(strstr(f.text, "has no photograph"));
    ck_assert_int_eq(strstr(f.text, "equals the photograph") != NULL, all);
  }
}

TEST(a_difference_is_shown)
{
  OWNED(fixture) f = begin(2, true, false);
  finish(&f);
  f.report.three.rtl.layer[FX_C2].sop[1]++;
  f.report.three.agreement = sf_fail(SF_E_DIFFERENCE, "C2 sop step 1: <core> differs");
  read_page(&f);
  faults found = {0};
  check_tags(&found, f.text);
  ck_assert_msg(found.count == 0, "%s", found.first);
  ck_assert_ptr_nonnull(strstr(f.text, "the counts differ"));
  ck_assert_ptr_nonnull(strstr(f.text, "&lt;core&gt; differs"));
  ck_assert_ptr_nonnull(strstr(f.text, "DIFFERENT"));
  f.report.three.rays = 0; /* already the first ray */
  read_page(&f);
  ck_assert_ptr_nonnull(strstr(f.text, "the counts differ"));
  ck_assert_ptr_null(strstr(f.text, "was left out"));
}

/* What a usual audit does not have: a trained twin, random rays, no traffic of the accelerator, a saturated layer. */
TEST(what_is_rare_is_shown)
{
  static const char *const words[] = {
      "trained by itself takes",
      "3.5 % more",
      "Unexpected in C1:",
      "\nrandom\nrays audited",
      "(the pictures show one view)",
      "The audited rays are estimated",
      "<td class=\"n\">\xe2\x80\x93</td><td class=\"n\"><data data-key=\"rtl_subset.recount",
      "x&amp;y --model a/m&amp;m.safetensors</pre>",
      "<code>m&amp;m.safetensors</code>",
      "<code>0123abcd</code>"};
  OWNED(fixture) f = begin(2, true, false);
  finish(&f);
  f.report.twin = (sf_twin){"twin.safetensors", 100, 5, 2300000, -3.5};
  f.report.random_rays = true, f.page.whole = false;
  f.report.three.rtl_events = SF_TRAFFIC_LOOKUP;
  f.report.measure.core.saturated_samples[FX_C1] = 3;
  f.page.model = "a/m&m.safetensors";
  snprintf(f.page.model_sha256, sizeof f.page.model_sha256, "0123abcd");
  read_page(&f);
  check_plain(f.text);
  for (int i = 0; i < COUNT(words); i++) ck_assert_msg(strstr(f.text, words[i]), "the page does not say: %s", words[i]);
}

/* ---- planted faults ---- */

typedef struct plant {
  const char *from, *to; /* the first occurrence is replaced */
} plant;

static const plant plants[] = {
    {"data-key=\"energy_spiking_fj\" value=\"", "data-key=\"energy_spiking_fj\" value=\"1"},
    {"data-key=\"ledgers.list[3].total_fj\" value=\"", "data-key=\"ledgers.list[3].total_fj\" value=\"1"},
    {"data-key=\"samples\" value", "data-key=\"rays\" value"},
    {"data-key=\"ledgers.list[1].parts_fj.mac\"", "data-was=\"ledgers\""},
    {"data-key=\"page.layer_fj[0][0]\" data-value=\"", "data-key=\"page.layer_fj[0][0]\" data-value=\"9"},
    {"<data data-key=\"ledgers.list[8].total_fj\" value=\"", "<data data-was=\""},
    {"</header>", ""},
    {"</figure>", ""},
    {"</td>", "<td>"},
    {"class=\"facts\"", "class=facts"},
    {"id=\"fig-golden\"", "id=\"fig-gold\""},
    {"id=\"svg-quality\"", "id=\"svg-q\""},
    {"src=\"data:image", "src=\"https://a.org/image"},
    {"href=\"#limits\"", "href=\"https://a.org\""},
    {"id=\"limits\"", "id=\"limit\""},
    {"<style>", "<style>@import 'x';"},
    {"&lt;", "&nbsp;"},
    {"<li>", "<b>"},
    {">equal<", ">DIFFERENT<"},
    {"id=\"table-units\"", "id=\"table-unit\""},
    {"rows[0].unit_fj.mac\" value=\"", "rows[0].unit_fj.mac\" value=\"1"},
    {"data-key=\"ledger.hoisted_saving_percent\" value=\"", "data-key=\"ledger.hoisted_saving_percent\" value=\"1"},
};

TEST(planted_faults_are_seen)
{
  OWNED(fixture) f = begin(2, true, false);
  finish(&f);
  for (size_t i = 0; i < sizeof plants / sizeof *plants; i++) {
    const char *at = strstr(f.text, plants[i].from);
    ck_assert_msg(at, "nothing to plant at: %s", plants[i].from);
    const size_t before = (size_t)(at - f.text), room = strlen(f.text) + 64;
    char *page = malloc(room);
    snprintf(page, room, "%.*s%s%s", (int)before, f.text, plants[i].to, at + strlen(plants[i].from));
    const faults found = judge(page, &f.report);
    ck_assert_msg(found.count > 0, "not seen: %s -> %s", plants[i].from, plants[i].to);
    free(page);
  }
}

ck_options ck_program = {.set_up = make_folder, .tear_down = remove_folder};
