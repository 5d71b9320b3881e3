/* The server of sf_view: what it takes for a parameter, whom it answers, and what it leaves undone. */
#include "ck_run.h"
#include "view/training.h"
#include "base/clock.h"
#include "tests/float_fixture.h"
#include <arpa/inet.h>
#include <stdatomic.h>
#include <time.h>
#include <unistd.h>

#define CAMERA "20,10,25.5,25.5,10,5,1,0,0,0,0,1,0,0,0,0,1,4"

/* ---- parameters ---- */

static sf_status add(const char *key, const char *value)
{
  sf_view_ask ask;
  sf_view_ask_begin(&ask);
  return sf_view_ask_add(&ask, key, value);
}

TEST(parameters_are_read)
{
  sf_view_ask a;
  sf_view_ask_begin(&a);
  ck_assert_int_eq(a.view, -1);
  ck_assert_int_eq(a.source, SF_VIEW_FIXED);
  ck_ok(sf_view_ask_add(&a, "view", "7"));
  ck_ok(sf_view_ask_add(&a, "steps", "8"));
  ck_ok(sf_view_ask_add(&a, "source", "rtl"));
  ck_ok(sf_view_ask_add(&a, "window", "1,2,3,4"));
  ck_ok(sf_view_ask_add(&a, "map", "spikes-c1"));
  ck_ok(sf_view_ask_add(&a, "camera", CAMERA));
  ck_assert(a.view == 7 && a.steps == 8 && a.source == SF_VIEW_RTL && a.stride == -1);
  ck_assert(a.window[0] == 1 && a.window[3] == 4 && a.has_camera && a.camera.width == 20);
  ck_assert_str_eq(a.map, "spikes-c1");
  ck_bad(sf_view_ask_add(&a, "view", "7"), SF_E_USAGE, "view", "once");
}

TEST(parameters_out_of_range)
{
  static const char *const bad[][2] = {{"steps", "0"},
                                       {"steps", "9"},
                                       {"steps", "1x"},
                                       {"steps", ""},
                                       {"steps", " 1"},
                                       {"steps", "+1"},
                                       {"view", "-1"},
                                       {"view", "99999999999999999999"},
                                       {"x", "4096"},
                                       {"layer", "5"},
                                       {"neuron", "100000"},
                                       {"source", "board"},
                                       {"source", ""},
                                       {"window", "1,2,3"},
                                       {"window", "1,2,3,0"},
                                       {"window", "1,2,3,4,5"},
                                       {"window", "1,2,3,5000"},
                                       {"map", "../etc/passwd"},
                                       {"map", ""},
                                       {"map", "aaaaaaaaaaaaaaaaaaaaaaaaa"},
                                       {"kind", "EXR"},
                                       {"camera", "20,10,25.5"},
                                       {"camera", CAMERA ","},
                                       {"camera", CAMERA ",1"},
                                       {"camera", CAMERA ",1,2,3,4,5"},
                                       {"camera", "20,10,nan,25.5,10,5,1,0,0,0,0,1,0,0,0,0,1,4"},
                                       {"camera", "20,10,0x1,25.5,10,5,1,0,0,0,0,1,0,0,0,0,1,4"},
                                       {"camera", "20,10,0,25.5,10,5,1,0,0,0,0,1,0,0,0,0,1,4"},
                                       {"camera", "20.5,10,1,25.5,10,5,1,0,0,0,0,1,0,0,0,0,1,4"},
                                       {"camera", "5000,10,1,25.5,10,5,1,0,0,0,0,1,0,0,0,0,1,4"},
                                       {"camera", "20,10,1,1e9,10,5,1,0,0,0,0,1,0,0,0,0,1,4"}};
  for (int i = 0; i < COUNT(bad); i++) ck_bad(add(bad[i][0], bad[i][1]), SF_E_USAGE, "", "");
  ck_bad(add("steps", NULL), SF_E_USAGE, "steps", "a value");
  ck_bad(add("path", "/etc/passwd"), SF_E_USAGE, "that is none", "");
}

TEST(a_camera_comes_back)
{
  sf_camera first, second;
  char text[SF_CAMERA_TEXT], again[SF_CAMERA_TEXT];
  ck_ok(sf_camera_parse(CAMERA ",0.1,-0.02,1e-5,0.3333333", &first));
  for (int i = 0; i < 12; i++) first.to_world[i] = -1.2345678e-7f * (float)(i + 1);
  sf_camera_print(&first, text);
  ck_ok(sf_camera_parse(text, &second));
  sf_camera_print(&second, again);
  ck_assert_str_eq(text, again);
  ck_assert_mem_eq(first.to_world, second.to_world, sizeof first.to_world);
  ck_assert(first.k1 == second.k1 && first.p2 == second.p2 && first.fx == second.fx);
}

TEST(who_is_the_page)
{
  static const char *const own[] = {"127.0.0.1:8323", "localhost:1", "localhost", "[::1]:80", "10.0.0.7:8323"};
  static const char *const others[] = {"evil.example:8323",
                                       "127.0.0.1.evil.example",
                                       "localhost.evil.example",
                                       "",
                                       ":80",
                                       "127.0.0.1:",
                                       "127.0.0.1:80x",
                                       "[::1",
                                       "[evil.example]:80",
                                       "127.0.0.1:999999",
                                       "1",
                                       "[::1]x",
                                       "127.0.0.1:80@evil.example"};
  for (int i = 0; i < COUNT(own); i++) ck_assert_msg(sf_view_is_own(own[i], NULL), "%s", own[i]);
  for (int i = 0; i < COUNT(others); i++) ck_assert_msg(!sf_view_is_own(others[i], NULL), "%s", others[i]);
  ck_assert(!sf_view_is_own(NULL, NULL));
  ck_assert(sf_view_is_own("127.0.0.1:80", "http://127.0.0.1:80"));
  ck_assert(!sf_view_is_own("127.0.0.1:80", "http://evil.example"));
  ck_assert(!sf_view_is_own("127.0.0.1:80", "http://127.0.0.1:81"));
  ck_assert(!sf_view_is_own("127.0.0.1:80", "null"));
}

/* ---- over a socket ---- */

static atomic_int pieces, ended, asked;

static sf_status piece(void *stream, void **data, size_t *size)
{
  (void)stream;
  nanosleep(&(struct timespec){.tv_nsec = 5000000}, NULL);
  *size = 100000, *data = calloc(1, *size);
  pieces++;
  return sf_ok();
}

static void end(void *stream)
{
  (void)stream;
  ended++;
}

static sf_status answer_text(void *user, const sf_view_ask *ask, sf_view_reply *reply)
{
  (void)user;
  asked++;
  if (ask->steps == 3) return sf_fail(SF_E_RANGE, "no \"three\"");
  return sf_view_reply_text(reply, "text/plain", "hello");
}

static sf_status answer_endless(void *user, const sf_view_ask *ask, sf_view_reply *reply)
{
  (void)user, (void)ask;
  reply->next = piece, reply->end = end;
  return sf_ok();
}

static const sf_view_route routes[] = {{"/", answer_text}, {"/endless", answer_endless}, {NULL, NULL}};

static sf_view_server *serve(int *port, char token[33])
{
  sf_view_server *server;
  ck_ok(sf_view_open(&server, &(sf_view_options){.routes = routes}));
  ck_assert_int_eq(sscanf(sf_view_url(server), "http://127.0.0.1:%d/?token=%32s", port, token), 2);
  ck_assert_uint_eq(strlen(token), 32);
  return server;
}

static int dial(int port)
{
  const struct sockaddr_in to = {
      .sin_family = AF_INET, .sin_port = htons((uint16_t)port), .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
  const int s = socket(AF_INET, SOCK_STREAM, 0);
  ck_assert(s >= 0 && !connect(s, (const struct sockaddr *)&to, sizeof to));
  return s;
}

static void say(int s, const char *text)
{
  for (size_t n = strlen(text); n > 0;) {
    const ssize_t sent = send(s, text, n, MSG_NOSIGNAL);
    if (sent <= 0) return; /* refused before the end */
    text += sent, n -= (size_t)sent;
  }
}

/* Status of the reply, its text in `reply`; 0 where the connection was closed without one. */
static int talk(int port, const char *request, char reply[4096])
{
  const int s = dial(port);
  size_t n = 0;
  say(s, request);
  for (ssize_t got; n < 4095 && (got = recv(s, reply + n, 4095 - n, 0)) > 0;) n += (size_t)got;
  reply[n] = 0;
  close(s);
  return n > 12 ? atoi(reply + 9) : 0;
}

static int get(int port, const char *target, const char *headers, char reply[4096])
{
  char request[8192];
  snprintf(request, sizeof request, "GET %s HTTP/1.1\r\nConnection: close\r\n%s\r\n", target, headers);
  return talk(port, request, reply);
}

#define LOCAL "Host: 127.0.0.1:80\r\n"

TEST(strangers_are_refused)
{
  char token[33], good[80], text[160], reply[4096];
  int port;
  sf_view_server *server = serve(&port, token);
  snprintf(good, sizeof good, "/?token=%s", token);
  ck_assert_int_eq(get(port, good, LOCAL, reply), 200);
  ck_assert(strstr(reply, "hello") && strstr(reply, "Content-Security-Policy") && strstr(reply, "no-store"));
  ck_assert(strstr(reply, "no-referrer") && !strstr(reply, "Access-Control"));
  const int before = asked;
  ck_assert_int_eq(get(port, "/", LOCAL, reply), 403);
  ck_assert_int_eq(get(port, "/?token=", LOCAL, reply), 403);
  ck_assert_int_eq(get(port, "/?token=00000000000000000000000000000000", LOCAL, reply), 403);
  snprintf(text, sizeof text, "%s0", good);
  ck_assert_int_eq(get(port, text, LOCAL, reply), 403);
  ck_assert_int_eq(get(port, good, "Host: evil.example\r\n", reply), 403);
  ck_assert_int_eq(get(port, good, LOCAL "Origin: http://evil.example\r\n", reply), 403);
  snprintf(text, sizeof text, "GET %s HTTP/1.0\r\n\r\n", good);
  ck_assert_int_eq(talk(port, text, reply), 403); /* no Host */
  snprintf(text, sizeof text, "POST %s HTTP/1.1\r\n" LOCAL "Content-Length: 0\r\nConnection: close\r\n\r\n", good);
  ck_assert_int_eq(talk(port, text, reply), 405);
  ck_assert_int_eq(asked, before);
  sf_view_close(server);
}

TEST(what_is_asked_wrongly)
{
  char token[33], target[200], reply[4096];
  int port;
  sf_view_server *server = serve(&port, token);
  static const struct {
    const char *target, *word;
    int status;
  } wrong[] = {{"/none?token=%s", "no such page", 404},
               {"/../etc/passwd?token=%s", "no such page", 404},
               {"/%%2e%%2e/x?token=%s", "no such page", 404},
               {"/?token=%s&steps=99", "steps", 400},
               {"/?token=%s&file=%%2fetc", "that is none", 400},
               {"/?token=%s&steps=1&steps=1", "once", 400},
               {"/?token=%s&steps", "a value", 400},
               {"/?token=%s&steps=3", "no \\\"three\\\"", 409}};
  for (int i = 0; i < COUNT(wrong); i++) {
    snprintf(target, sizeof target, wrong[i].target, token);
    ck_assert_int_eq(get(port, target, LOCAL, reply), wrong[i].status);
    ck_assert_msg(strstr(reply, wrong[i].word), "%s: %s", target, reply);
  }
  sf_view_close(server);
}

TEST(requests_are_bounded)
{
  char token[33], reply[4096];
  int port, held[SF_VIEW_CONNECTIONS + 8];
  sf_view_server *server = serve(&port, token);
  char *huge = malloc(200001);
  memset(huge, 'a', 200000), huge[200000] = 0;
  memcpy(huge, "GET /?x=", 8);
  const int status = talk(port, huge, reply);
  ck_assert_msg(status == 0 || status == 414 || status == 431 || status == 413 || status == 400, "%d", status);
  ck_assert_int_eq(talk(port, "\r\n\x01\xff\r\n\r\n", reply) / 100 == 2, 0);
  for (int i = 0; i < COUNT(held); i++) held[i] = dial(port);
  nanosleep(&(struct timespec){.tv_nsec = 200000000}, NULL);
  char byte;
  int closed = 0;
  for (int i = 0; i < COUNT(held); i++) closed += recv(held[i], &byte, 1, MSG_DONTWAIT) == 0;
  ck_assert_int_ge(closed, 8);
  for (int i = 0; i < COUNT(held); i++) close(held[i]);
  free(huge);
  sf_view_close(server);
}

static bool comes(atomic_int *what, int number)
{
  for (int i = 0; i < 1000 && *what != number; i++) nanosleep(&(struct timespec){.tv_nsec = 10000000}, NULL);
  return *what == number;
}

TEST(a_page_that_goes_stops_the_work)
{
  char token[33], request[200], some[1000];
  int port;
  sf_view_server *server = serve(&port, token);
  snprintf(request, sizeof request, "GET /endless?token=%s HTTP/1.1\r\n" LOCAL "\r\n", token);
  const int s = dial(port);
  say(s, request);
  ck_assert(recv(s, some, sizeof some, 0) > 0);
  ck_assert_int_eq(ended, 0);
  close(s);
  ck_assert(comes(&ended, 1));
  const int done = pieces;
  nanosleep(&(struct timespec){.tv_nsec = 100000000}, NULL);
  ck_assert_int_eq(pieces, done);
  sf_view_close(server);
}

TEST(streams_are_few_and_end_with_the_server)
{
  char token[33], request[200], reply[4096];
  int port, s[SF_VIEW_STREAMS];
  sf_view_server *server = serve(&port, token);
  snprintf(request, sizeof request, "GET /endless?token=%s HTTP/1.1\r\n" LOCAL "Connection: close\r\n\r\n", token);
  for (int i = 0; i < SF_VIEW_STREAMS; i++) {
    s[i] = dial(port);
    say(s[i], request);
    ck_assert(recv(s[i], reply, 100, 0) > 0);
  }
  ck_assert_int_eq(talk(port, request, reply), 503);
  ck_assert(comes(&ended, 1)); /* of the refused one */
  sf_view_close(server);
  ck_assert_int_eq(ended, SF_VIEW_STREAMS + 1);
  for (int i = 0; i < SF_VIEW_STREAMS; i++) close(s[i]);
}

TEST(addresses)
{
  sf_view_server *server, *second;
  int port;
  char token[33];
  ck_bad(sf_view_open(&server, &(sf_view_options){.routes = routes, .address = "here"}), SF_E_USAGE, "here", "address");
  ck_bad(sf_view_open(&server, &(sf_view_options){.routes = routes, .address = "192.0.2.1"}), SF_E_IO, "192.0.2.1", "");
  server = serve(&port, token);
  ck_assert(sf_view_idle(server) > 1e6);
  ck_bad(sf_view_open(&second, &(sf_view_options){.routes = routes, .port = port}), SF_E_IO, "port", "");
  sf_view_close(server);
}

TEST(pages_are_small_and_fetch_nothing)
{
  for (int page = SF_VIEW_PAGE_SCENE; page <= SF_VIEW_PAGE_TRAINING; page++) {
    sf_view_reply reply = {0};
    ck_ok(sf_view_page_make((sf_view_page)page, &reply));
    ck_assert_uint_lt(reply.size, 200000);
    ck_assert_ptr_null(strstr(reply.data, "http:"));
    ck_assert_ptr_null(strstr(reply.data, "https:"));
    ck_assert_ptr_nonnull(strstr(reply.data, "</html>"));
    free(reply.data);
  }
}

/* ---- training ---- */

static sf_train_stats stats_of(int64_t iteration)
{
  return (sf_train_stats){.stage = 1,
                          .iteration = iteration,
                          .progress = 0.5,
                          .seconds = 10,
                          .loss = 0.1,
                          .mse = 0.01,
                          .t_star = 3.5,
                          .t_r = 4,
                          .quiet = {1, 2, 3}};
}

/* A page that asks again and again, while it trains: previews come, and take their share of the time. */
TEST(previews_take_their_share)
{
  OWNED(sf_model) model = test_model(SF_NET_SNN, SF_HYBRID, 32, 4, 0.5f);
  sf_view view = {.name = "held"};
  ck_ok(sf_camera_parse("64,64,60,60,32,32,1,0,0,0,0,1,0,0,0,0,1,2", &view.camera));
  sf_dataset held_out = {.view = &view, .count = 1, .scale = 1};
  sf_view_training *t;
  char reply[4096], target[100];
  int port;
  char token[33];
  ck_ok(sf_view_training_open(&t, 0, &held_out));
  ck_assert_int_eq(sscanf(sf_view_url(sf_view_training_server(t)), "http://127.0.0.1:%d/?token=%32s", &port, token), 2);
  for (int i = 1; i <= 3000; i++) {
    const sf_train_stats s = stats_of(i);
    sf_view_training_step(t, &model, &s);
  }
  ck_assert(sf_view_training_spent(t) == 0); /* nobody looked */
  snprintf(target, sizeof target, "/training?token=%s", token);
  const double begun = sf_seconds();
  double longest = 0;
  for (int i = 3001; sf_seconds() - begun < 4; i++) {
    const sf_train_stats s = stats_of(i);
    const double before = sf_view_training_spent(t);
    if (i % 50 == 1) ck_assert_int_eq(get(port, target, LOCAL, reply), 200);
    sf_view_training_step(t, &model, &s);
    longest = fmax(longest, sf_view_training_spent(t) - before);
    nanosleep(&(struct timespec){.tv_nsec = 2000000}, NULL);
  }
  ck_assert_ptr_null(strstr(reply, "\"preview\":0,"));
  const double share = SF_VIEW_TRAINING_SHARE * (sf_seconds() - begun);
  ck_assert_msg(sf_view_training_spent(t) <= share + longest, "%g s of %g s", sf_view_training_spent(t), share);
  ck_assert_ptr_nonnull(strstr(reply, "\"quiet\":[1,2,3]"));
  snprintf(target, sizeof target, "/preview?token=%s", token);
  ck_assert_int_eq(get(port, target, LOCAL, reply), 200);
  sf_view_training_close(t);
}
