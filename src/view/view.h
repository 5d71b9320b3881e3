/* A page on this machine and what it asks for: a server for one user with a browser, which nobody else can reach. It
 * answers GET alone, and nothing that it is asked names a file. */
#ifndef SF_VIEW_VIEW_H
#define SF_VIEW_VIEW_H
#include "base/arch.h"
#include "base/json.h"
#include "scene/scene.h"

/* ---- what is asked ---- */

typedef enum { SF_VIEW_FIXED, SF_VIEW_FLOAT, SF_VIEW_RTL, SF_VIEW_PHOTO, SF_VIEW_SOURCES } sf_view_source;
extern const char *const sf_view_source_names[SF_VIEW_SOURCES]; /* "fixed", "float", "rtl", "photo" */

enum {
  SF_VIEW_SIDE = 4096 /* pixels of a picture's side */,
  SF_VIEW_STRIDE = 32,
  SF_VIEW_WORD = 24,
  SF_VIEW_SAMPLES = 1 << 20
};
/* The parameters of a request, each within its range whatever was sent. What was not given is -1, or empty. */
typedef struct sf_view_ask {
  bool has_camera;
  sf_camera camera;
  int view;      /* of the data set */
  int steps;     /* 1..SF_T_MAX */
  int source;    /* sf_view_source */
  int stride;    /* 1..SF_VIEW_STRIDE: of the first pictures, every so many pixels */
  int finish;    /* 1: until every pixel is there */
  int window[4]; /* x, y, width, height; width 0: not given */
  int x, y;
  int sample, layer, neuron;
  char map[SF_VIEW_WORD + 1], kind[SF_VIEW_WORD + 1]; /* of a-z, 0-9 and '-' */
  unsigned given;                                     /* internal: which parameters came */
} sf_view_ask;
void sf_view_ask_begin(sf_view_ask *ask);
/* One parameter. SF_E_USAGE names it: it is unknown, came before, or its value is out of range. */
sf_status sf_view_ask_add(sf_view_ask *ask, const char *key, const char *value);

/* Whether a request came from the page itself: Host is "localhost" or an address in numbers, which no name server can
 * turn elsewhere, and Origin, if there is one, is that host's. Either may be NULL: not sent. */
bool sf_view_is_own(const char *host, const char *origin);

/* ---- what is answered ---- */

typedef struct sf_view_reply {
  const char *type; /* media type; NULL: JSON */
  const char *file; /* NULL, or under which name the browser saves it */
  void *data;       /* malloc'ed; the server frees it */
  size_t size;
  /* A reply in pieces, in place of data: the next one, malloc'ed; NULL ends it. Called from the connection's thread,
   * and no more once the page is gone. */
  sf_status (*next)(void *stream, void **data, size_t *size);
  void (*end)(void *stream); /* always called */
  void *stream;
} sf_view_reply;

/* Printed JSON or text as a reply; frees json, SF_E_MEMORY where it is NULL. */
sf_status sf_view_reply_json(sf_view_reply *reply, cJSON *json);
sf_status sf_view_reply_text(sf_view_reply *reply, const char *type, const char *text);

typedef struct sf_view_route {
  const char *path;                                                              /* "/picture" */
  sf_status (*answer)(void *user, const sf_view_ask *ask, sf_view_reply *reply); /* of any thread, many at a time */
} sf_view_route;

/* ---- the server ---- */

typedef struct sf_view_options {
  const char *address;         /* in numbers; NULL: 127.0.0.1 */
  int port;                    /* 0: a free one */
  const sf_view_route *routes; /* ends with a NULL path */
  void *user;
} sf_view_options;
typedef struct sf_view_server sf_view_server;
/* At most SF_VIEW_CONNECTIONS at a time and SF_VIEW_STREAMS replies in pieces; a connection that is silent for a minute
 * is closed. SF_E_IO: the port is taken, or the address is not this machine's. */
enum { SF_VIEW_CONNECTIONS = 24, SF_VIEW_STREAMS = 6 };
sf_status sf_view_open(sf_view_server **server, const sf_view_options *options);
/* "http://127.0.0.1:8323/?token=..." */
const char *sf_view_url(const sf_view_server *server);
/* Seconds since the page asked for something; large before it did. */
double sf_view_idle(const sf_view_server *server);
/* Opens the address in a browser where there is a display. */
void sf_view_browse(const sf_view_server *server);
void sf_view_close(sf_view_server *server); /* replies in pieces end; NULL is fine */

/* The pages, each one text with style and script inside. */
typedef enum { SF_VIEW_PAGE_SCENE, SF_VIEW_PAGE_TRAINING } sf_view_page;
sf_status sf_view_page_make(sf_view_page page, sf_view_reply *reply);
#endif
