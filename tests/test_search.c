/* The search for t*: where worth and price meet, on curves that are known; and two scenes of unlike difficulty. */
#include "ck_run.h"
#include "train_fixture.h"

static void set_up(void)
{
  open_scene(12);
}

/* A trainer at the start of stage II, with the net's firing of a fifth. */
static sf_trainer *searcher(const sf_train_options *o)
{
  sf_trainer *t = start(&data, o, NULL);
  t->stage = 2;
  t->batch.rays = 100;
  t->batch.samples = 500;
  for (int r = 0; r < 25; r++) t->batch.ray[r].count = 20;
  for (int l = 0; l < 3; l++) t->firing[l] = 0.2;
  t->model.t_r = T - 1;
  t->model.t_star = T - 1;
  sf_search_begin(t);
  return t;
}

/* Prefix t has the error floor + height / 2^(t-1), times 1 + noise that changes from call to call. */
typedef struct curve {
  double floor, height, noise, fall; /* fall: of all errors over the search, exponent */
} curve;

static uint64_t noise_seed = 5;
static double own_noise; /* of each prefix alone */

static double error_of(const curve *c, int prefix, double at, int call)
{
  const double shake = 1 + c->noise * (2 * sf_random_float(noise_seed, 1, (uint64_t)call) - 1) +
                       own_noise * (2 * sf_random_float(noise_seed, 2, (uint64_t)(T * call + prefix)) - 1);
  return (c->floor + c->height * pow(0.5, prefix - 1)) * shake * exp(-c->fall * at);
}

/* n full iterations over the whole search, or until it ends. */
static void measure(sf_trainer *t, const curve *c, int n, double ratio)
{
  for (int i = 0; i < n && t->search.state == SF_SEARCH_RUNNING; i++) {
    sf_loss_sums mean = {0};
    const double at = (i + 1.0) / n;
    for (int p = 1; p <= T; p++) mean.prefix[p - 1] = error_of(c, p, at, i);
    sf_search_update(t, &mean, ratio, at);
  }
  sf_search_end(t);
}

/* Least squares by the normal equations. */
static double slope_of(const curve *c)
{
  double sx = 0, sy = 0, sxx = 0, sxy = 0;
  for (int p = 1; p <= T; p++) {
    const double y = error_of(c, p, 0, 0);
    sx += p, sy += y, sxx += p * p, sxy += p * y;
  }
  return -(T * sxy - sx * sy) / (T * sxx - sx * sx);
}

static sf_train_options search_run(void)
{
  sf_train_options o = small_run();
  o.beta = 5e-7;
  return o;
}

TEST(worth_equals_price)
{
  static const double betas[] = {1e-7, 5e-7, 1e-6};
  const curve c = {1e-3, 1e-4, 0, 0};
  const double worth = slope_of(&c), ratio = 0.9;
  for (int i = 0; i < 3; i++) {
    sf_train_options o = search_run();
    o.beta = betas[i];
    OWNED(trainer) t = searcher(&o);
    measure(t, &c, 40, ratio);
    const sf_search_report r = sf_search_now(t);
    const double expected = log(worth / (o.beta * ratio));
    ck_assert_double_eq_tol(t->model.t_star, expected, 1e-5);
    ck_assert_int_eq(t->model.t_r, lround(expected));
    ck_assert_double_eq_tol(r.worth, worth, 1e-9 * worth);
    ck_assert_double_eq_tol(r.price, worth, 1e-5 * worth);
    ck_assert_double_lt(r.worth_error, 1e-6 * worth);
    ck_assert_int_eq(r.state, SF_SEARCH_BALANCED);
    ck_assert_double_lt(t->search.at, 0.6); /* it rests, so it stops */
  }
}

/* t* of noisy curves that fall, at a search rate. */
static double found(const curve *c, double rate, sf_search_report *report)
{
  sf_train_options o = search_run();
  o.search_rate = rate;
  sf_trainer *t = searcher(&o);
  measure(t, c, 200, 1);
  const double t_star = t->model.t_star;
  *report = sf_search_now(t);
  sf_trainer_free(t);
  return t_star;
}

TEST(the_rate_decides_nothing)
{
  const curve c = {1e-3, 1e-4, 0.1, 0.4};
  sf_search_report slow, normal, fast;
  const double at = found(&c, 1, &normal);
  ck_assert_double_eq_tol(found(&c, 3, &fast), at, 0.3);
  ck_assert_double_eq_tol(found(&c, 1.0 / 3, &slow), at, 0.3);
  /* The standard error is of the size of the noise: 0.1 / sqrt(3) a batch, over 200 memory / rate / 2 batches or so. */
  ck_assert_double_gt(normal.worth_error, 0.005 * normal.worth);
  ck_assert_double_lt(normal.worth_error, 0.05 * normal.worth);
  ck_assert_double_gt(fast.worth_error, 1.2 * normal.worth_error);
}

/* Mean square of what the worth is off in 2000 noisy searches, over that of its standard error. */
static double spread_over_error(int measurements, double noise, double own)
{
  const curve c = {1e-3, 1e-4, noise, 0}, quiet = {1e-3, 1e-4, 0, 0};
  const double worth = slope_of(&quiet);
  const sf_train_options o = search_run();
  OWNED(trainer) t = searcher(&o);
  double off = 0, error = 0;
  own_noise = own;
  for (int run = 0; run < 2000; run++) {
    noise_seed = 100 + (uint64_t)run;
    sf_search_begin(t);
    measure(t, &c, measurements, 1);
    const sf_search_report r = sf_search_now(t);
    off += pow(r.worth - worth, 2);
    error += pow(r.worth_error, 2);
  }
  noise_seed = 5, own_noise = 0;
  return off / error;
}

/* 1, within five standard errors of such a ratio: two measurements have errors of one degree of freedom, sqrt(4 / 2000)
 * each way. */
TEST(standard_errors_are_the_spread)
{
  static const int measurements[] = {2, 3, 12};
  for (size_t i = 0; i < sizeof measurements / sizeof *measurements; i++) {
    ck_assert_double_eq_tol(spread_over_error(measurements[i], 0.1, 0), 1, 0.25);
    ck_assert_double_eq_tol(spread_over_error(measurements[i], 0, 0.005), 1, 0.25);
    ck_assert_double_eq_tol(spread_over_error(measurements[i], 0.1, 0.005), 1, 0.25);
  }
}

/* Of one measurement nothing is known but itself; t* is not called balanced, however quiet it is. */
TEST(one_measurement_has_no_error)
{
  const curve c = {1e-3, 1e-4, 0, 0};
  const sf_train_options o = search_run();
  OWNED(trainer) t = searcher(&o);
  measure(t, &c, 1, 1);
  const sf_search_report r = sf_search_now(t);
  ck_assert_int_eq(r.measured, 1);
  ck_assert(isinf(r.worth_error) && isinf(r.price_error));
  ck_assert_int_eq(r.state, SF_SEARCH_NOT_REACHED);
}

TEST(the_scene_decides)
{
  const curve easy = {1e-4, 1e-5, 0, 0}, hard = {1e-3, 1e-4, 0, 0};
  sf_search_report r;
  ck_assert_double_eq_tol(found(&hard, 1, &r) - found(&easy, 1, &r), log(10), 1e-4);
}

TEST(ends_of_the_range)
{
  const curve c = {1e-3, 1e-4, 0.9, 0}, rising = {1e-3, -1e-4, 0, 0}, nothing = {0}; /* however noisy it is */
  static const struct {
    double beta;
    int steps;
  } cases[] = {{0, T}, {1e-12, T}, {1, 1}};
  for (int i = 0; i < 3; i++) {
    sf_train_options o = search_run();
    o.beta = cases[i].beta;
    OWNED(trainer) t = searcher(&o);
    measure(t, &c, 40, 1);
    ck_assert_int_eq(t->model.t_r, cases[i].steps);
    ck_assert_double_eq(t->model.t_star, cases[i].steps);
    ck_assert_int_eq(t->search.state, SF_SEARCH_AT_END);
  }
  const curve *const worthless[] = {&rising, &nothing};
  for (int i = 0; i < 2; i++) {
    sf_train_options o = search_run();
    OWNED(trainer) t = searcher(&o);
    measure(t, worthless[i], 40, 1);
    ck_assert_int_eq(t->model.t_r, 1);
    ck_assert(isfinite(sf_search_now(t).worth) && isfinite(sf_search_now(t).worth_error));
  }
  sf_train_options o = search_run();
  o.no_penalty = true;
  OWNED(trainer) t = searcher(&o);
  measure(t, &c, 40, 1);
  ck_assert_int_eq(t->model.t_r, T);
}

TEST(what_was_not_reached_is_said)
{
  const curve falling = {1e-3, 1e-4, 0, 2}, still = {1e-3, 1e-4, 0, 0};
  sf_train_options o = search_run();
  sf_trainer *t = searcher(&o);
  measure(t, &falling, 40, 1);
  ck_assert_int_eq(t->search.state, SF_SEARCH_NOT_REACHED);
  sf_trainer_free(t);
  t = searcher(&o);
  measure(t, &still, 1, 1); /* moves all the same: it is all that is known */
  ck_assert_int_eq(t->search.state, SF_SEARCH_NOT_REACHED);
  ck_assert_double_eq_tol(t->model.t_star, log(slope_of(&still) / 5e-7), 1e-5);
  sf_trainer_free(t);
  t = searcher(&o);
  sf_search_end(t);
  ck_assert_int_eq(t->search.state, SF_SEARCH_TOO_SHORT);
  ck_assert_int_eq(t->model.t_r, T - 1);
  sf_trainer_free(t);
}

/* t* at the end against where it was marked: at least half a quarter of the search ago by itself, scaled to a quarter;
 * sooner the larger of that and what it moved in the quarter before. 0.3 is close enough. */
TEST(how_far_it_moved_at_the_end)
{
  static const struct {
    double at, mark_at, since, moved;
    sf_search_state state;
  } rows[] = {{0.8, 0.75, 0.1, 0.05, SF_SEARCH_BALANCED},    {0.8, 0.75, 0.1, 0.29, SF_SEARCH_BALANCED},
              {0.8, 0.75, 0.1, 0.31, SF_SEARCH_NOT_REACHED}, {0.8, 0.75, 0.29, 0, SF_SEARCH_BALANCED},
              {0.8, 0.75, 0.31, 0, SF_SEARCH_NOT_REACHED},   {0.8, 0.75, -0.31, 0, SF_SEARCH_NOT_REACHED},
              {0.9, 0.75, 0.17, 9, SF_SEARCH_BALANCED},      {0.9, 0.75, 0.19, 0, SF_SEARCH_NOT_REACHED},
              {0.87, 0.75, 0.1, 9, SF_SEARCH_NOT_REACHED},   {0.88, 0.75, 0.1, 9, SF_SEARCH_BALANCED},
              {0.88, 0.75, -0.15, 0, SF_SEARCH_BALANCED},    {0.88, 0.75, 0.16, 0, SF_SEARCH_NOT_REACHED},
              {0.99, 0.75, 0.28, 9, SF_SEARCH_BALANCED},     {0.99, 0.75, 0.3, 0, SF_SEARCH_NOT_REACHED},
              {0.24, 0, 0, 0, SF_SEARCH_NOT_REACHED}};
  const curve c = {1e-3, 1e-4, 0, 0};
  for (int i = 0; i < COUNT(rows); i++) {
    const sf_train_options o = search_run();
    OWNED(trainer) t = searcher(&o);
    for (int k = 0; k < 8; k++) {
      sf_loss_sums mean = {0};
      for (int p = 1; p <= T; p++) mean.prefix[p - 1] = error_of(&c, p, 0, 0);
      sf_search_update(t, &mean, 1, 0.01 * (k + 1));
    }
    ck_assert_int_eq(t->search.state, SF_SEARCH_RUNNING);
    t->search.at = rows[i].at, t->search.mark_at = rows[i].mark_at;
    t->search.mark = (double)t->model.t_star - rows[i].since, t->search.moved = rows[i].moved;
    sf_search_end(t);
    ck_assert_msg(t->search.state == (int)rows[i].state, "row %d: %s", i, sf_search_names[t->search.state]);
  }
}

/* Errors of 1..T steps at random, and their lower convex hull as drawn by hand: for each step the least slope of any
 * chord that spans it. Between steps what one more is worth is geometric. */
TEST(worth_along_the_hull)
{
  for (uint64_t seed = 0; seed < 40; seed++) {
    sf_train_options o = search_run();
    o.price = seed % 2 ? SF_PRICE_ENERGY : SF_PRICE_EXPONENTIAL;
    o.objective = seed % 2 ? SF_OBJECTIVE_PREFIXES : SF_OBJECTIVE_PAPER;
    o.beta = seed % 2 ? 1 : 1e-7;
    OWNED(trainer) t = searcher(&o);
    sf_loss_sums mean = {0};
    double hull[T], gain[T];
    for (int p = 0; p < T; p++) mean.prefix[p] = 1e-3 - 1e-4 * p + 3e-4 * (double)sf_random_float(seed, 9, (uint64_t)p);
    for (int i = 0; i < 6; i++) sf_search_update(t, &mean, 1, 0.01 * (i + 1));
    for (int p = 0; p < T; p++) { /* the lowest chord over each point */
      hull[p] = mean.prefix[p];
      for (int a = 0; a < p; a++)
        for (int b = p + 1; b < T; b++)
          hull[p] = fmin(hull[p], mean.prefix[a] + (mean.prefix[b] - mean.prefix[a]) * (p - a) / (b - a));
    }
    for (int p = 0; p + 1 < T; p++) gain[p] = fmax(hull[p] - hull[p + 1], 1e-3 * fmax(hull[0] - hull[1], 1e-12));
    for (int k = 0; k <= 40; k++) {
      t->model.t_star = 1 + (float)(T - 1) * (float)k / 40;
      const double x = fmin(fmax((double)t->model.t_star - 1.5, 0), T - 2);
      const int i = (int)fmin(floor(x), T - 3);
      const double worth = exp(log(gain[i]) + (log(gain[i + 1]) - log(gain[i])) * (x - i));
      const sf_search_report r = sf_search_now(t);
      ck_assert_msg(fabs(r.worth - worth) <= 1e-6 * worth, "seed %d, t* %g: %g instead of %g", (int)seed,
                    (double)t->model.t_star, r.worth, worth);
      const double each = sf_search_energy(t, 2) - sf_search_energy(t, 1);
      ck_assert_double_eq_tol(r.price, o.beta * (seed % 2 ? each : exp((double)t->model.t_star)), 1e-6 * r.price);
    }
  }
}

/* The price of a step is what the ledger says: the step at which it is no longer worth it. */
TEST(energy_as_price)
{
  const curve c = {1e-3, 1e-4, 0, 0};
  sf_train_options o = search_run();
  o.price = SF_PRICE_ENERGY;
  sf_trainer *t = searcher(&o);
  t->stride = 1;
  measure(t, &c, 40, 1);
  const sf_config *g = &t->model.config;
  const double h = g->hidden, frame = 5 * 24 * 24, sop = 0.2 * h * (SF_DENSITY_OUT + h + 3);
  const double step = 0.9 * sop * frame * 1e-9, of_h = 4.6 * h * SF_GEO_FEATURES * frame * 1e-9; /* mJ */
  ck_assert_double_eq_tol(sf_search_now(t).step_energy, step, 1e-9 * step);
  /* All of it: D1's products once, the direction's for a ray of 20 samples, h's once where layers wait, else at every
   * step; the twin multiplies at every synapse. */
  const double once = of_h + 4.6 * h * (2 * g->levels + SF_DIR_FEATURES / 20.0) * frame * 1e-9;
  const double twin = 4.6 * h * (2 * g->levels + SF_DENSITY_OUT + 31 + h + 3) * frame * 1e-9;
  ck_assert_double_eq_tol(sf_search_energy(t, 2), once + 2 * step, 1e-9 * once);
  ck_assert_double_eq_tol(sf_search_saving(t, 2), 1 - (once + 2 * step) / twin, 1e-9);
  t->model.config.mode = SF_HYBRID;
  ck_assert_double_eq_tol(sf_search_now(t).step_energy, step + of_h, 1e-9 * step);
  ck_assert_double_eq_tol(sf_search_energy(t, 2), once + of_h + 2 * step, 1e-9 * once);
  sf_trainer_free(t);
  /* Where intervals are four times those of the file, and will be twice those, frames have twice as many samples. */
  t = searcher(&o);
  t->stride = 4;
  measure(t, &c, 40, 1);
  ck_assert_double_eq_tol(sf_search_now(t).step_energy, 2 * step, 1e-9 * step);
  ck_assert_double_eq_tol(sf_search_energy(t, 2), 2 * (once + 2 * step), 1e-9);
  sf_trainer_free(t);
  for (int k = 2; k < T; k++) { /* step k saves more than it costs, step k+1 less */
    o.beta = 1e-4 * pow(0.5, k) * sqrt(2) / step;
    t = searcher(&o);
    t->stride = 1;
    measure(t, &c, 40, 1);
    ck_assert_int_eq(t->model.t_r, k);
    const sf_search_report r = sf_search_now(t);
    ck_assert_double_eq_tol(r.worth, r.price, 1e-5 * r.price);
    sf_trainer_free(t);
  }
}

TEST(targets_find_beta)
{
  const curve c = {1e-3, 1e-3, 0, 0}; /* 2e-3, 1.5e-3, 1.25e-3, ... */
  sf_train_options o = search_run();
  const double best = error_of(&c, T, 0, 0);
  for (int k = 1; k < T; k++) {
    o.target_loss = 10 * log10(error_of(&c, k, 0, 0) / best) + 1e-6;
    OWNED(trainer) t = searcher(&o);
    measure(t, &c, 40, 1);
    ck_assert_int_eq(t->model.t_r, k);
    const sf_search_report r = sf_search_now(t);
    ck_assert_double_eq_tol(r.beta, slope_of(&c) / exp(k), 1e-6 * r.beta);
    ck_assert_double_eq_tol(r.price, r.worth, 1e-9);
  }
  o.target_loss = 0;
  for (int k = 1; k < 3; k++) { /* more would cost more than the twin of so few neurons */
    sf_trainer *t = searcher(&o);
    measure(t, &c, 40, 1);
    o.target_saving = 100 * sf_search_saving(t, k) - 1e-6;
    ck_assert_double_gt(o.target_saving, 1);
    sf_trainer_free(t);
    t = searcher(&o);
    measure(t, &c, 40, 1);
    ck_assert_int_eq(t->model.t_r, k);
    ck_assert_int_eq(t->search.state, SF_SEARCH_BALANCED);
    sf_trainer_free(t);
    o.target_saving = 0;
  }
  o.target_saving = 99.9;
  OWNED(trainer) t = searcher(&o);
  measure(t, &c, 40, 1);
  ck_assert_int_eq(t->model.t_r, 1);
  ck_assert_int_eq(t->search.state, SF_SEARCH_MISSED);
}

/* The whole trainer on the textured scene with so much contrast, at a search rate: where t* ends. */
static double learned(float contrast, double rate)
{
  sf_dataset scene = load("train");
  for (int v = 0; v < scene.count; v++) {
    const sf_image *image = &scene.view[v].image;
    for (size_t i = 0; i < (size_t)image->width * (size_t)image->height; i++)
      for (int c = 0; c < 3; c++) image->rgba[4 * i + c] = (uint16_t)((float)image->rgba[4 * i + c] * contrast);
  }
  sf_train_options o = small_run();
  o.background = 2;
  o.beta = 5e-7;
  o.search_rate = rate;
  o.stage1 = 100;
  o.stage2 = 400;
  o.samples = 2048;
  sf_trainer *t = start(&scene, &o, NULL);
  const sf_train_stats s = steps(t, o.stage1 + o.stage2);
  sf_trainer_free(t);
  sf_dataset_free(&scene);
  return s.t_star;
}

/* A search whose rate decides finds the same steps for both, and other ones at another rate. */
LONG_TEST(two_scenes_at_one_beta)
{
  for (int i = 0; i < 2; i++) {
    const double rate = i ? 3 : 1.0 / 3, easy = learned(0.4f, rate), hard = learned(1, rate);
    if (getenv("SHOW")) fprintf(stderr, "%g %g\n", easy, hard);
    ck_assert_msg(lround(hard) > lround(easy), "rate %g: t* = %g and %g", rate, easy, hard);
  }
}

int ck_timeout = 240;
ck_options ck_program = {.set_up_all = set_up, .tear_down_all = close_scene, .one_process = true};
