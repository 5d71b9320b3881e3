/* The search for t*: how many time steps are worth their price on this scene.
 *
 * A full iteration unrolls all T steps and measures the squared error M_t of every prefix on the same rays. What one
 * more step is worth is the least-squares slope of that curve. L_penalty charges beta (M_T / M_smooth) e^t. The two are
 * equal at t = ln(worth / (beta M_T / M_smooth)): Newton's step on a price that is an exponential is exact, so t* is
 * put where the averages balance, and no rate decides where that is.
 *
 * The worth falls while the nets learn, mostly because the error as a whole does: the share of the error that a step
 * saves hardly changes. So that share is averaged over much of the search, the error over its last part alone, and the
 * worth is their product. Older measurements fade out of both. */
#include "field/field.h"
#include "train/internal.h"
#include <math.h>
#include <string.h>

const char *const sf_search_names[] = {"none",          "running",     "balanced",  "at the end of 1..T",
                                       "target missed", "not reached", "too short", NULL};

/* In units of the search's share of stage II: the memory of the error's average and of the share's, and how far back t*
 * is compared to see whether it rests. */
static const double memory = 0.08, share_memory = 0.25, quarter = 0.25;
/* Full iterations before t* moves: one alone may have any slope. */
enum { FIRST_MOVE = 4 };
/* t* rests when it moved less than this in a quarter of the search, and its standard error is below it. */
static const double still = 0.1;
/* At the end of the search t* counts as reached up to this. */
static const double close_enough = 0.3;

/* Least-squares slope of the error over 1..n steps, downwards: what one more step saves. */
static double slope(const double *error, int n)
{
  double along = 0, square = 0;
  for (int i = 0; i < n; i++) {
    const double x = i - 0.5 * (n - 1);
    along += x * error[i];
    square += x * x;
  }
  return -along / square;
}

/* Energy of a sample that runs n steps, pJ: the paper's prices. D1's products once, the direction's once a ray, the
 * additions of spikes at every step, and so h's products, but where layers wait. */
static double sample_energy(const sf_trainer *t, double n)
{
  const sf_config *c = &t->model.config;
  const double mac = 4.6, sop = 0.9, hidden = c->hidden;
  const double *firing = t->search.firing;
  const double inputs = sf_field_of(c)->inputs(c);
  if (sf_model_decodes(&t->model))
    return mac * hidden * inputs + n * sop * hidden * (firing[1] * hidden + firing[2] * 3);
  const double h = SF_GEO_FEATURES * (c->mode == SF_RADIX ? 1 : n);
  return mac * hidden * (inputs + h + SF_DIR_FEATURES * t->search.rays_per_sample) +
         n * hidden * sop * (firing[0] * SF_DENSITY_OUT + firing[1] * hidden + firing[2] * 3);
}

/* Of the ReLU twin: every synapse a MAC, once. */
static double twin_energy(const sf_model *m)
{
  const double mac = 4.6, hidden = m->config.hidden;
  double synapses = 0;
  for (int l = 0; l < SF_LAYERS; l++) synapses += (double)m->param[sf_layer_weights[l]].size;
  return mac * hidden * (synapses / hidden);
}

/* Of the error that one more step saves; nothing of no error. */
static double share_of(const sf_search *s)
{
  return s->level > 0 ? s->slope / s->level : 0;
}

/* What one more step from t on is worth, as squared error. To the exponential price it is the slope of the whole curve.
 * To a price per step, and in the paper's objective, it is the slope at t of the curve's convex hull, geometric between
 * the middles of its steps. */
static double worth_at(const sf_trainer *t, double at)
{
  const sf_search *s = &t->search;
  const int n = t->model.config.steps;
  if (t->options.price == SF_PRICE_EXPONENTIAL && t->options.objective == SF_OBJECTIVE_PREFIXES) {
    double error = 0;
    for (int i = 0; i < n; i++) error += s->prefix[i] / n;
    return share_of(s) * error;
  }
  double gain[SF_T_MAX];
  int size[SF_T_MAX], parts = 0;
  for (int i = 0; i + 1 < n; i++) { /* pool adjacent violators: gains that do not rise */
    gain[parts] = s->prefix[i] - s->prefix[i + 1];
    size[parts++] = 1;
    while (parts > 1 && gain[parts - 2] < gain[parts - 1]) {
      const int a = size[parts - 2], b = size[parts - 1];
      gain[parts - 2] = (a * gain[parts - 2] + b * gain[parts - 1]) / (a + b);
      size[--parts - 1] = a + b;
    }
  }
  double level[SF_T_MAX] = {0};
  for (int p = 0, i = 0; p < parts; p++)
    for (int k = 0; k < size[p]; k++) level[i++] = fmax(gain[p], 1e-3 * fmax(gain[0], 1e-12));
  const double x = fmin(fmax(at - 1.5, 0), n - 2);
  const int i = (int)fmin(floor(x), n > 2 ? n - 3 : 0), next = n > 2 ? i + 1 : i;
  return level[i] * pow(level[next] / level[i], x - i);
}

/* L_penalty's slope at t, without beta. */
static double unit_price_at(const sf_trainer *t, double at)
{
  const sf_search *s = &t->search;
  if (t->options.no_penalty) return 0;
  if (t->options.price == SF_PRICE_EXPONENTIAL) return s->ratio * exp(at);
  return s->ratio * (sf_search_energy(t, 2) - sf_search_energy(t, 1));
}

double sf_search_energy(const sf_trainer *t, double steps)
{
  return sample_energy(t, steps) * t->search.samples_per_frame * 1e-9;
}

double sf_search_saving(const sf_trainer *t, double steps)
{
  return 1 - sample_energy(t, steps) / twin_energy(&t->model);
}

/* Where worth and price meet, or the end of 1..T on which side they do. */
static double balance(const sf_trainer *t)
{
  double low = 1, high = t->model.config.steps;
  const double beta = t->options.beta;
  if (worth_at(t, low) <= beta * unit_price_at(t, low)) return low;
  if (worth_at(t, high) >= beta * unit_price_at(t, high)) return high;
  for (int i = 0; i < 60; i++) {
    const double middle = 0.5 * (low + high);
    *(worth_at(t, middle) > beta * unit_price_at(t, middle) ? &low : &high) = middle;
  }
  return low;
}

/* The fewest steps whose error is at most `decibel` above the best prefix's. */
static double fewest_steps(const sf_trainer *t, double decibel)
{
  const int n = t->model.config.steps;
  double best = INFINITY;
  for (int i = 0; i < n; i++) best = fmin(best, t->search.prefix[i]);
  int steps = 1;
  while (steps < n && t->search.prefix[steps - 1] > best * pow(10, decibel / 10)) steps++;
  return steps;
}

/* The most steps that save this share of the twin's energy; 1 where none does. */
static double most_steps(const sf_trainer *t, double saving)
{
  const int n = t->model.config.steps;
  for (int i = n; i > 1; i--)
    if (sf_search_saving(t, i) >= saving) return i;
  return 1;
}

static double wanted(const sf_trainer *t)
{
  const sf_train_options *o = &t->options;
  if (o->target_loss > 0) return fewest_steps(t, o->target_loss);
  if (o->target_saving > 0) return most_steps(t, o->target_saving / 100);
  return balance(t);
}

static bool has_target(const sf_trainer *t)
{
  return t->options.target_loss > 0 || t->options.target_saving > 0;
}

/* beta with which worth and price are equal at t*: the given one, or the one that the target stands for. */
static double beta_of(const sf_trainer *t)
{
  const double unit = unit_price_at(t, t->model.t_star);
  if (!has_target(t)) return t->options.beta;
  return unit > 0 ? fmax(worth_at(t, t->model.t_star), 0) / unit : 0;
}

static double squared(double x)
{
  return x * x;
}

/* Square sum of the batches' shares of an average: 1 / n of n that count alike. */
static double part_of(const double weight[2])
{
  return weight[1] / squared(weight[0]);
}

/* Standard error of an average over its value, from the batches' spread about an average, which may have a memory of
 * its own. That is less than their spread about the mean, by a factor of 1 - part. So one batch, or one that outweighs
 * all before it, says nothing of it: INFINITY. */
static double relative_error(double variance, double mean, const double spread[2], const double weight[2])
{
  const double left = 1 - part_of(spread);
  if (!(left > 1e-9)) return INFINITY;
  return sqrt(fmax(variance, 0) / left * part_of(weight)) / fmax(fabs(mean), 1e-300);
}

/* Of the worth: that of the share, whose batches differ by what their slope departs from share times error, and that of
 * the error. */
static double worth_error(const sf_search *s)
{
  const double share = share_of(s);
  const double off = s->slope2 - 2 * share * s->slope_level + share * share * s->level2;
  return hypot(relative_error(off, s->slope, s->slow, s->slow),
               relative_error(s->level2 - squared(s->level), s->level, s->slow, s->fast));
}

/* Standard error from the relative one. Unknown stays unknown where the value is 0. */
static double error_of(double value, double relative)
{
  return isinf(relative) ? relative : fabs(value) * relative;
}

sf_search_report sf_search_now(const sf_trainer *t)
{
  const sf_search *s = &t->search;
  sf_search_report r = {.state = (sf_search_state)s->state, .measured = s->measured, .beta = t->options.beta};
  memcpy(r.prefix_mse, s->prefix, sizeof r.prefix_mse);
  if (!s->measured) return r;
  const double at = t->model.t_star;
  r.beta = beta_of(t);
  r.worth = worth_at(t, at);
  r.price = r.beta * unit_price_at(t, at);
  r.worth_error = error_of(r.worth, worth_error(s));
  r.price_error = error_of(r.price, relative_error(s->ratio2 - squared(s->ratio), s->ratio, s->fast, s->fast));
  r.saving = sf_search_saving(t, t->model.t_r);
  r.step_energy = sf_search_energy(t, 2) - sf_search_energy(t, 1);
  return r;
}

void sf_search_begin(sf_trainer *t)
{
  t->search =
      (sf_search){.state = t->model.config.steps > 1 && !t->options.fixed_steps && !sf_tuning(t) ? SF_SEARCH_RUNNING
                                                                                                 : SF_SEARCH_NONE};
}

/* Counts one more measurement in an average that forgets; its share of the average. */
static double count(double weight[2], double forget)
{
  weight[0] = forget * weight[0] + 1;
  weight[1] = forget * forget * weight[1] + 1;
  return 1 / weight[0];
}

/* One full iteration into the averages. at: share of the search that is done. */
static void average(sf_trainer *t, const sf_loss_sums *mean, double ratio, double at)
{
  sf_search *s = &t->search;
  const int n = t->model.config.steps;
  const double gone = (at - s->at) * t->options.search_rate, now = slope(mean->prefix, n);
  const double fast = count(s->fast, exp(-gone / memory)), slow = count(s->slow, exp(-gone / share_memory));
  double level = 0;
  for (int i = 0; i < n; i++) {
    s->prefix[i] += fast * (mean->prefix[i] - s->prefix[i]);
    level += mean->prefix[i] / n;
  }
  s->slope += slow * (now - s->slope);
  s->slope2 += slow * (now * now - s->slope2);
  s->slope_level += slow * (now * level - s->slope_level);
  s->level += slow * (level - s->level);
  s->level2 += slow * (level * level - s->level2);
  s->ratio += fast * (ratio - s->ratio);
  s->ratio2 += fast * (ratio * ratio - s->ratio2);
  for (int l = 0; l < 3; l++) s->firing[l] += fast * (t->firing[l] - s->firing[l]);
  const sf_camera *c = &t->data->view[0].camera;
  const double samples = fmax(t->batch.samples, 1), each = samples * sf_batch_finer(t) / t->batch.rays;
  const double frame = each * c->width * c->height;
  int rays = 0; /* that have a sample. Shorter intervals share them more: the saving is rather too low */
  for (int r = 0; r < t->batch.rays; r++) rays += t->batch.ray[r].count > 0;
  s->samples_per_frame += fast * (frame - s->samples_per_frame);
  s->rays_per_sample += fast * (rays / samples - s->rays_per_sample);
  s->at = at;
  s->measured++;
}

/* Does t* rest? Looks back every quarter of the search. */
static bool rests(sf_trainer *t)
{
  sf_search *s = &t->search;
  const double now = t->model.t_star;
  if (s->measured == FIRST_MOVE) s->mark = now, s->mark_at = s->at;
  if (s->at < s->mark_at + quarter) return false;
  const double moved = fabs(now - s->mark), error = worth_error(s);
  const bool same = lround(now) == lround(s->mark);
  s->mark = now;
  s->mark_at = s->at;
  s->moved = moved;
  return moved < still && error < still && same;
}

static void move(sf_trainer *t)
{
  t->model.t_star = (float)wanted(t);
  t->model.t_r = (int)lroundf(t->model.t_star);
}

void sf_search_update(sf_trainer *t, const sf_loss_sums *mean, double ratio, double at)
{
  average(t, mean, ratio, at);
  if (t->search.measured < FIRST_MOVE) return;
  move(t);
  if (rests(t)) sf_search_end(t);
}

/* At 1 or T steps worth and price are apart by more than the worth is uncertain. */
static bool at_end(const sf_trainer *t)
{
  const double at = t->model.t_star, price = t->options.beta * unit_price_at(t, at), worth = worth_at(t, at);
  if (has_target(t) || (at > 1 && at < t->model.config.steps)) return false;
  return price == 0 || fabs(worth - price) > 3 * error_of(worth, worth_error(&t->search));
}

/* Targets that no number of steps meets, t* at an end of 1..T, and a search that ends before t* rests have words of
 * their own. */
void sf_search_end(sf_trainer *t)
{
  sf_search *s = &t->search;
  if (s->state != SF_SEARCH_RUNNING) return;
  if (s->measured) move(t);
  /* In a quarter of the search: in the one before where t* was marked just now. */
  const double part = (s->at - s->mark_at) / quarter, since = fabs(t->model.t_star - s->mark);
  const double moved = part < 0.5 ? fmax(since, s->moved) : since / part;
  if (!s->measured)
    s->state = SF_SEARCH_TOO_SHORT;
  else if (t->options.target_saving > 0 && sf_search_saving(t, t->model.t_r) < t->options.target_saving / 100)
    s->state = SF_SEARCH_MISSED;
  else if (at_end(t))
    s->state = SF_SEARCH_AT_END;
  else if (moved > close_enough || s->mark_at == 0 || worth_error(s) > close_enough)
    s->state = SF_SEARCH_NOT_REACHED;
  else
    s->state = SF_SEARCH_BALANCED;
}
