/* Technology files: one price a line, `key value unit source`, so that an error can name the line. */
#include "base/io.h"
#include "energy/ledger.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { FILE_LIMIT = 1 << 20, WIDTH_MAX = 256, REGISTER_BITS = 32, ACCESS_BITS = 64 };
static const uint64_t FJ_MAX = 1000000000000; /* 1 mJ: far above any access, and products stay far below 2^63 */

static const char *const families[SF_PRICE_KEYS] = {
    "fp32_mac", "fp32_add", "int_add",       "int_multiply",      "sram",    "dram",      "register", "mac",
    "twin_mac", "sop",      "neuron_update", "integrator_update", "special", "tag_lookup"};

static bool has_points(int family)
{
  return family == SF_PRICE_INT_ADD || family == SF_PRICE_INT_MULTIPLY || family == SF_PRICE_SRAM;
}

/* Where the reader is; every message begins with it. */
typedef struct reader {
  const char *path;
  int line;
  sf_technology *to;
} reader;

static int family_of(const char *key)
{
  for (int f = 0; f < SF_PRICE_KEYS; f++) {
    const size_t n = strlen(families[f]);
    if (strncmp(key, families[f], n)) continue;
    if (key[n] == 0 || key[n] == '.') return f;
  }
  return -1;
}

/* The next word of *text, cut off with a NUL; "" at the end of the line. */
static char *next_word(char **text)
{
  char *word = *text + strspn(*text, " \t");
  char *end = word + strcspn(word, " \t");
  *text = *end ? end + 1 : end;
  *end = 0;
  return word;
}

/* Digits with at most 9 decimals times `scale`, exactly; false if it is no such number or no whole one. */
static bool whole_fj(const char *digits, uint64_t scale, uint64_t *fj)
{
  uint64_t mantissa = 0, divisor = 1;
  bool point = false, any = false;
  for (const char *p = digits; *p; p++) {
    if (*p == '.' && !point) {
      point = true;
      continue;
    }
    if (*p < '0' || *p > '9' || mantissa > FJ_MAX || divisor > 100000000) return false;
    mantissa = 10 * mantissa + (uint64_t)(*p - '0'), any = true;
    if (point) divisor *= 10;
  }
  *fj = mantissa * scale / divisor;
  return any && mantissa * scale % divisor == 0;
}

static sf_status parse_value(const reader *r, const char *key, const char *value, const char *unit, uint64_t *fj)
{
  static const struct {
    const char *name;
    uint64_t scale;
  } units[] = {{"fJ", 1}, {"pJ", 1000}, {"nJ", 1000000}};
  if (!*value) return sf_fail(SF_E_FORMAT, "%s:%d: key '%s' has no value", r->path, r->line, key);
  for (size_t i = 0; i < sizeof units / sizeof *units; i++) {
    if (strcmp(unit, units[i].name)) continue;
    if (!whole_fj(value, units[i].scale, fj))
      return sf_fail(SF_E_FORMAT, "%s:%d: key '%s': '%s %s' is not a whole number of fJ", r->path, r->line, key, value,
                     unit);
    if (*fj > FJ_MAX)
      return sf_fail(SF_E_RANGE, "%s:%d: key '%s': %s %s is more than 1 mJ", r->path, r->line, key, value, unit);
    return sf_ok();
  }
  return sf_fail(SF_E_FORMAT, "%s:%d: key '%s': unit '%s' is not fJ, pJ or nJ", r->path, r->line, key, unit);
}

/* The number behind the point: a width in bits or a size in bytes. */
static sf_status parse_point(const reader *r, const char *key, int family, uint32_t *at)
{
  const char *digits = key + strlen(families[family]);
  *at = 0;
  if (!has_points(family)) {
    if (*digits) return sf_fail(SF_E_FORMAT, "%s:%d: key '%s' takes no '%s'", r->path, r->line, key, digits);
    return sf_ok();
  }
  char *end = NULL;
  const unsigned long limit = family == SF_PRICE_SRAM ? 1u << 31 : WIDTH_MAX;
  const unsigned long value = *digits ? strtoul(digits + 1, &end, 10) : 0;
  if (!end || *end || digits[1] < '0' || digits[1] > '9' || value < 1 || value > limit)
    return sf_fail(SF_E_FORMAT, "%s:%d: key '%s': expected %s.%s, 1 to %lu", r->path, r->line, key, families[family],
                   family == SF_PRICE_SRAM ? "BYTES" : "BITS", limit);
  *at = (uint32_t)value;
  return sf_ok();
}

/* Keeps the list in order of families and points. */
static sf_status insert(const reader *r, const sf_price *price, int family)
{
  sf_technology *t = r->to;
  int at = t->count;
  for (int i = 0; i < t->count; i++)
    if (family_of(t->price[i].key) == family && t->price[i].at == price->at)
      return sf_fail(SF_E_FORMAT, "%s:%d: key '%s' is there twice, first as '%s'", r->path, r->line, price->key,
                     t->price[i].key);
  if (t->count == SF_PRICES_MAX)
    return sf_fail(SF_E_RANGE, "%s:%d: key '%s': more than %d prices", r->path, r->line, price->key, SF_PRICES_MAX);
  for (; at > 0; at--) {
    const sf_price *before = &t->price[at - 1];
    const int other = family_of(before->key);
    if (other < family || (other == family && before->at < price->at)) break;
    t->price[at] = *before;
  }
  t->price[at] = *price;
  t->count++;
  return sf_ok();
}

static sf_status parse_text(const reader *r, const char *key, char *text, char *to, size_t size)
{
  text += strspn(text, " \t");
  size_t n = strlen(text);
  while (n > 0 && (text[n - 1] == ' ' || text[n - 1] == '\t')) n--;
  if (n == 0) return sf_fail(SF_E_FORMAT, "%s:%d: key '%s' has no text", r->path, r->line, key);
  if (n >= size)
    return sf_fail(SF_E_RANGE, "%s:%d: key '%s': more than %zu characters", r->path, r->line, key, size - 1);
  memcpy(to, text, n);
  to[n] = 0;
  return sf_ok();
}

static sf_status parse_price(const reader *r, const char *key, char *rest)
{
  const int family = family_of(key);
  if (family < 0) return sf_fail(SF_E_FORMAT, "%s:%d: unknown key '%s'", r->path, r->line, key);
  sf_price price = {.fj = 0};
  if (strlen(key) >= sizeof price.key)
    return sf_fail(SF_E_FORMAT, "%s:%d: key '%.40s...' is too long", r->path, r->line, key);
  strcpy(price.key, key);
  SF_TRY(parse_point(r, key, family, &price.at));
  const char *value = next_word(&rest), *unit = next_word(&rest);
  SF_TRY(parse_value(r, key, value, unit, &price.fj));
  snprintf(price.text, sizeof price.text, "%.30s %s", value, unit);
  rest += strspn(rest, " \t");
  if (!*rest) return sf_fail(SF_E_FORMAT, "%s:%d: key '%s' has no source behind its price", r->path, r->line, key);
  SF_TRY(parse_text(r, key, rest, price.source, sizeof price.source));
  return insert(r, &price, family);
}

static sf_status parse_line(const reader *r, char *line)
{
  char *rest = line;
  const char *key = next_word(&rest);
  if (!*key || *key == '#') return sf_ok();
  if (!strcmp(key, "name")) return parse_text(r, key, rest, r->to->name, sizeof r->to->name);
  if (!strcmp(key, "title")) return parse_text(r, key, rest, r->to->title, sizeof r->to->title);
  return parse_price(r, key, rest);
}

static int points(const sf_technology *t, int family)
{
  int n = 0;
  for (int i = 0; i < t->count; i++) n += family_of(t->price[i].key) == family;
  return n;
}

static sf_status check(const sf_technology *t, const char *path)
{
  if (!t->name[0]) return sf_fail(SF_E_FORMAT, "%s: key 'name' is missing", path);
  if (!t->title[0]) return sf_fail(SF_E_FORMAT, "%s: key 'title' is missing", path);
  for (int f = 0; f < SF_PRICE_FAMILIES; f++) {
    const int n = points(t, f);
    if (n == 0 && f != SF_PRICE_REGISTER) return sf_fail(SF_E_FORMAT, "%s: key '%s' is missing", path, families[f]);
    if (has_points(f) && n < 2)
      return sf_fail(SF_E_FORMAT, "%s: key '%s' needs two points to interpolate between", path, families[f]);
  }
  return sf_ok();
}

sf_status sf_technology_load(sf_technology *technology, const char *path)
{
  char *text;
  size_t size;
  *technology = (sf_technology){.count = 0};
  if (strlen(path) >= sizeof technology->path) return sf_fail(SF_E_RANGE, "%.100s...: the path is too long", path);
  strcpy(technology->path, path);
  SF_TRY(sf_read_file(path, FILE_LIMIT, &text, &size));
  reader r = {path, 0, technology};
  sf_status status = memchr(text, 0, size) ? sf_fail(SF_E_FORMAT, "%s: not a text file", path) : sf_ok();
  for (char *line = text, *next = line; next && status.code == SF_OK; line = next) {
    next = strchr(line, '\n');
    if (next) *next++ = 0;
    line[strcspn(line, "\r")] = 0;
    r.line++;
    status = parse_line(&r, line);
  }
  free(text);
  return status.code == SF_OK ? check(technology, path) : status;
}

/* ---- prices between those of the file ---- */

/* The neighbours of `at` among a family's points; both the first or the last two where it lies outside. */
static void neighbours(const sf_technology *t, int family, uint64_t at, const sf_price **low, const sf_price **high)
{
  const sf_price *first = NULL;
  int n = 0;
  for (int i = 0; i < t->count; i++)
    if (family_of(t->price[i].key) == family) first = n++ ? first : &t->price[i];
  int i = 1;
  while (i < n - 1 && first[i].at < at) i++;
  *low = &first[i - 1], *high = &first[i];
}

static uint64_t round_positive(double fj)
{
  return fj > 0 ? (uint64_t)llround(fj) : 0;
}

/* At x on the line through a and b; where it falls to nothing outside of them, the price of the nearer one. */
static uint64_t on_line(const sf_price *a, double x_a, const sf_price *b, double x_b, double x)
{
  const uint64_t fj = round_positive((double)a->fj + (x - x_a) / (x_b - x_a) * ((double)b->fj - (double)a->fj));
  if (fj > 0) return fj;
  return x < x_a ? a->fj : x > x_b ? b->fj : 0;
}

static void note(bool *interpolated, bool value)
{
  if (interpolated) *interpolated = *interpolated || value;
}

uint64_t sf_price_add(const sf_technology *technology, int bits, bool *interpolated)
{
  const sf_price *a, *b;
  neighbours(technology, SF_PRICE_INT_ADD, (uint64_t)bits, &a, &b);
  note(interpolated, a->at != (uint32_t)bits && b->at != (uint32_t)bits);
  return on_line(a, a->at, b, b->at, bits);
}

uint64_t sf_price_multiply(const sf_technology *technology, int a_bits, int b_bits, bool *interpolated)
{
  const sf_price *a, *b;
  const double cells = (double)a_bits * b_bits;
  neighbours(technology, SF_PRICE_INT_MULTIPLY, (uint64_t)ceil(sqrt(cells)), &a, &b);
  const double low = (double)a->at * a->at, high = (double)b->at * b->at;
  note(interpolated, cells != low && cells != high);
  return on_line(a, low, b, high, cells);
}

uint64_t sf_price_access(const sf_technology *technology, uint64_t memory_bytes, bool *interpolated)
{
  const sf_price *first, *a, *b, *last;
  neighbours(technology, SF_PRICE_SRAM, 0, &first, &a);
  neighbours(technology, SF_PRICE_SRAM, UINT64_MAX, &a, &last);
  neighbours(technology, SF_PRICE_SRAM, memory_bytes, &a, &b);
  if (memory_bytes <= first->at) return first->fj;
  if (memory_bytes > last->at) return last[1].fj; /* by family: DRAM's is behind the last sram */
  if (memory_bytes == b->at) return b->fj;
  note(interpolated, true);
  if (!a->fj || !b->fj) return 0;
  const double share = log((double)memory_bytes / a->at) / log((double)b->at / a->at);
  return round_positive((double)a->fj * pow((double)b->fj / (double)a->fj, share));
}

bool sf_price_measured(const sf_technology *technology, sf_price_family family, uint64_t *fj)
{
  for (int i = 0; i < technology->count; i++)
    if (family_of(technology->price[i].key) == (int)family) {
      *fj = technology->price[i].fj;
      return true;
    }
  return false;
}

uint64_t sf_price_register(const sf_technology *technology, int bits, bool *interpolated)
{
  uint64_t fj;
  if (sf_price_measured(technology, SF_PRICE_REGISTER, &fj)) return round_positive((double)fj * bits / REGISTER_BITS);
  note(interpolated, true);
  return round_positive((double)sf_price_access(technology, 1, NULL) * bits / ACCESS_BITS);
}
