/* Parameters of a request: whatever was sent, what comes out is within range. */
#include "view/view.h"
#include <stdlib.h>
#include <string.h>

const char *const sf_view_source_names[SF_VIEW_SOURCES] = {"fixed", "float", "rtl", "photo"};

enum { DIGITS = 9 };

static sf_status refuse(const char *key, const char *expected)
{
  return sf_fail(SF_E_USAGE, "%s: expected %s", key, expected);
}

/* Decimal digits and nothing else, up to `stop`, which is passed over unless it is the end. */
static bool read_whole(const char **text, char stop, int low, int high, int *value)
{
  const size_t n = strspn(*text, "0123456789");
  if (n == 0 || n > DIGITS || (*text)[n] != stop) return false;
  const int whole = (int)strtol(*text, NULL, 10);
  if (whole < low || whole > high) return false;
  *value = whole;
  *text += n + (stop != 0);
  return true;
}

static sf_status add_whole(const char *key, const char *text, int low, int high, int *value)
{
  char expected[64];
  if (read_whole(&text, 0, low, high, value)) return sf_ok();
  snprintf(expected, sizeof expected, "a whole number from %d to %d", low, high);
  return refuse(key, expected);
}

static sf_status add_word(const char *key, const char *text, char word[SF_VIEW_WORD + 1])
{
  const size_t n = strlen(text);
  if (n == 0 || n > SF_VIEW_WORD || strspn(text, "abcdefghijklmnopqrstuvwxyz0123456789-") != n)
    return refuse(key, "a word of a-z, 0-9 and -");
  memcpy(word, text, n + 1);
  return sf_ok();
}

static sf_status add_source(const char *key, const char *text, int *source)
{
  for (int i = 0; i < SF_VIEW_SOURCES; i++)
    if (!strcmp(text, sf_view_source_names[i])) return *source = i, sf_ok();
  return refuse(key, "fixed, float, rtl or photo");
}

static sf_status add_window(const char *key, const char *text, int window[4])
{
  int w[4];
  for (int i = 0; i < 4; i++)
    if (!read_whole(&text, i < 3 ? ',' : 0, i < 2 ? 0 : 1, SF_VIEW_SIDE, &w[i]))
      return refuse(key, "X,Y,WIDTH,HEIGHT in whole pixels");
  memcpy(window, w, sizeof w);
  return sf_ok();
}

static sf_status add_camera(sf_view_ask *ask, const char *text)
{
  sf_camera camera;
  SF_TRY(sf_camera_parse(text, &camera));
  if (camera.width > SF_VIEW_SIDE || camera.height > SF_VIEW_SIDE)
    return sf_fail(SF_E_USAGE, "camera: expected at most %d pixels on a side", SF_VIEW_SIDE);
  ask->camera = camera, ask->has_camera = true;
  return sf_ok();
}

typedef struct key {
  const char *name;
  size_t at; /* of an int in sf_view_ask */
  int low, high;
} key;

/* The whole numbers come first: their place is their bit in `given`. */
static const key keys[] = {{"view", offsetof(sf_view_ask, view), 0, 1 << 20},
                           {"steps", offsetof(sf_view_ask, steps), 1, SF_T_MAX},
                           {"stride", offsetof(sf_view_ask, stride), 1, SF_VIEW_STRIDE},
                           {"finish", offsetof(sf_view_ask, finish), 0, 1},
                           {"x", offsetof(sf_view_ask, x), 0, SF_VIEW_SIDE - 1},
                           {"y", offsetof(sf_view_ask, y), 0, SF_VIEW_SIDE - 1},
                           {"sample", offsetof(sf_view_ask, sample), 0, SF_VIEW_SAMPLES},
                           {"layer", offsetof(sf_view_ask, layer), 0, SF_LAYERS - 1},
                           {"neuron", offsetof(sf_view_ask, neuron), 0, SF_LANES - 1}};
enum { WHOLE = sizeof keys / sizeof *keys, CAMERA = WHOLE, WINDOW, SOURCE, MAP, KIND, KEYS };
static const char *const others[KEYS - WHOLE] = {"camera", "window", "source", "map", "kind"};

static int find(const char *name)
{
  for (int i = 0; i < WHOLE; i++)
    if (!strcmp(name, keys[i].name)) return i;
  for (int i = WHOLE; i < KEYS; i++)
    if (!strcmp(name, others[i - WHOLE])) return i;
  return -1;
}

void sf_view_ask_begin(sf_view_ask *ask)
{
  *ask = (sf_view_ask){.source = SF_VIEW_FIXED};
  for (int i = 0; i < WHOLE; i++) memcpy((char *)ask + keys[i].at, &(int){-1}, sizeof(int));
}

sf_status sf_view_ask_add(sf_view_ask *ask, const char *name, const char *value)
{
  const int i = find(name);
  if (i < 0) return sf_fail(SF_E_USAGE, "a parameter that is none was sent");
  if (!value) return refuse(name, "a value");
  if (ask->given & 1u << i) return refuse(name, "it once");
  ask->given |= 1u << i;
  if (i == CAMERA) return add_camera(ask, value);
  if (i == WINDOW) return add_window(name, value, ask->window);
  if (i == SOURCE) return add_source(name, value, &ask->source);
  if (i == MAP) return add_word(name, value, ask->map);
  if (i == KIND) return add_word(name, value, ask->kind);
  int whole = 0;
  SF_TRY(add_whole(name, value, keys[i].low, keys[i].high, &whole));
  memcpy((char *)ask + keys[i].at, &whole, sizeof whole);
  return sf_ok();
}

/* ---- where it comes from ---- */

/* Of "host" or "host:port"; 0 where the port is none. */
static size_t name_length(const char *host)
{
  const char *end = *host == '[' ? strchr(host, ']') : strchr(host, ':');
  const size_t n = *host == '[' ? (end ? (size_t)(end - host) + 1 : 0) : end ? (size_t)(end - host) : strlen(host);
  if (n == 0 || host[n] == 0) return n;
  if (host[n] != ':') return 0;
  const size_t digits = strspn(host + n + 1, "0123456789");
  return digits > 0 && digits <= 5 && host[n + 1 + digits] == 0 ? n : 0;
}

bool sf_view_is_own(const char *host, const char *origin)
{
  static const char scheme[] = "http://";
  if (!host) return false;
  const size_t n = name_length(host);
  const bool local = n == strlen("localhost") && !memcmp(host, "localhost", n);
  const bool six = n > 2 && *host == '[' && strspn(host + 1, "0123456789abcdefABCDEF:.") == n - 2;
  const bool four = n > 0 && strspn(host, "0123456789.") >= n && memchr(host, '.', n);
  if (!local && !six && !four) return false;
  return !origin || (!strncmp(origin, scheme, sizeof scheme - 1) && !strcmp(origin + sizeof scheme - 1, host));
}
