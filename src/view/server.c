/* The server: who may ask, how much at a time, and the replies on their way. */
#include "view/view.h"
#include "base/clock.h"
#include <arpa/inet.h>
#include <errno.h>
#include <inttypes.h>
#include <microhttpd.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <sys/wait.h>
#include <unistd.h>

enum { TOKEN = 16, IDLE = 60, MEMORY = 32 << 10, PIECE = 64 << 10 };

struct sf_view_server {
  sf_view_options options;
  struct MHD_Daemon *daemon;
  char token[2 * TOKEN + 1], url[160];
  _Atomic double asked; /* sf_seconds of the last good request; 0: none yet */
  atomic_int streams;
  atomic_bool stopping;
};

/* ---- replies ---- */

sf_status sf_view_reply_text(sf_view_reply *reply, const char *type, const char *text)
{
  reply->type = type, reply->size = strlen(text);
  reply->data = strdup(text);
  return reply->data ? sf_ok() : sf_fail(SF_E_MEMORY, "no memory for a reply");
}

sf_status sf_view_reply_json(sf_view_reply *reply, cJSON *json)
{
  char *text = json ? cJSON_PrintUnformatted(json) : NULL;
  cJSON_Delete(json);
  if (!text) return sf_fail(SF_E_MEMORY, "no memory for a reply");
  reply->data = text, reply->size = strlen(text), reply->type = NULL;
  return sf_ok();
}

static void drop(sf_view_reply *reply)
{
  free(reply->data);
  if (reply->end) reply->end(reply->stream);
  *reply = (sf_view_reply){0};
}

/* A reply in pieces, and the piece that is on its way. */
typedef struct flow {
  sf_view_server *server;
  sf_view_reply reply;
  char *piece;
  size_t size, sent;
} flow;

static ssize_t give(void *user, uint64_t at, char *to, size_t room)
{
  flow *f = user;
  (void)at;
  if (f->sent == f->size) {
    free(f->piece);
    f->piece = NULL, f->size = f->sent = 0;
    if (f->server->stopping) return MHD_CONTENT_READER_END_WITH_ERROR;
    if (f->reply.next(f->reply.stream, (void **)&f->piece, &f->size).code != SF_OK)
      return MHD_CONTENT_READER_END_WITH_ERROR;
    if (!f->piece) return MHD_CONTENT_READER_END_OF_STREAM;
  }
  const size_t n = f->size - f->sent < room ? f->size - f->sent : room;
  memcpy(to, f->piece + f->sent, n);
  f->sent += n;
  f->server->asked = sf_seconds();
  return (ssize_t)n;
}

static void end_flow(void *user)
{
  flow *f = user;
  f->server->streams--;
  free(f->piece);
  drop(&f->reply);
  free(f);
}

static struct MHD_Response *flowing(sf_view_server *server, sf_view_reply *reply)
{
  flow *f = calloc(1, sizeof *f);
  if (!f) return drop(reply), NULL;
  f->server = server, f->reply = *reply;
  server->streams++;
  struct MHD_Response *response = MHD_create_response_from_callback(MHD_SIZE_UNKNOWN, PIECE, give, f, end_flow);
  if (!response) end_flow(f);
  return response;
}

static enum MHD_Result queue(struct MHD_Connection *connection, unsigned status, struct MHD_Response *response,
                             const char *type, const char *file)
{
  static const char *const fixed[][2] = {
      {"Cache-Control", "no-store"},
      {"X-Content-Type-Options", "nosniff"},
      {"Referrer-Policy", "no-referrer"},
      {"Cross-Origin-Resource-Policy", "same-origin"},
      {"Content-Security-Policy", "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src "
                                  "'self' data: blob:; connect-src 'self'; base-uri 'none'; form-action 'none'; "
                                  "frame-ancestors 'none'"}};
  char name[100];
  if (!response) return MHD_NO;
  for (size_t i = 0; i < sizeof fixed / sizeof *fixed; i++) MHD_add_response_header(response, fixed[i][0], fixed[i][1]);
  MHD_add_response_header(response, "Content-Type", type ? type : "application/json");
  snprintf(name, sizeof name, "attachment; filename=\"%.60s\"", file ? file : "");
  if (file) MHD_add_response_header(response, "Content-Disposition", name);
  const enum MHD_Result result = MHD_queue_response(connection, status, response);
  MHD_destroy_response(response);
  return result;
}

static enum MHD_Result refuse(struct MHD_Connection *connection, unsigned status, const char *why)
{
  cJSON *json = cJSON_CreateObject();
  sf_view_reply reply = {0};
  sf_json_add_text(json, "error", why);
  if (sf_view_reply_json(&reply, json).code != SF_OK) return MHD_NO;
  return queue(connection, status, MHD_create_response_from_buffer(reply.size, reply.data, MHD_RESPMEM_MUST_FREE), NULL,
               NULL);
}

/* ---- requests ---- */

typedef struct reading {
  sf_view_ask ask;
  sf_status status;
  const char *token;
} reading;

static enum MHD_Result read_parameter(void *user, enum MHD_ValueKind kind, const char *name, const char *value)
{
  reading *r = user;
  (void)kind;
  if (!strcmp(name, "token"))
    r->token = value;
  else if (r->status.code == SF_OK)
    r->status = sf_view_ask_add(&r->ask, name, value);
  return MHD_YES;
}

/* In a time that does not tell how many characters are right. */
static bool is_token(const sf_view_server *server, const char *given)
{
  unsigned different = 0;
  if (!given || strlen(given) != 2 * TOKEN) return false;
  for (int i = 0; i < 2 * TOKEN; i++) different |= (unsigned)(given[i] ^ server->token[i]);
  return different == 0;
}

static const sf_view_route *find_route(const sf_view_server *server, const char *path)
{
  for (const sf_view_route *r = server->options.routes; r->path; r++)
    if (!strcmp(r->path, path)) return r;
  return NULL;
}

static unsigned code_of(const sf_status *status)
{
  return status->code == SF_E_MEMORY  ? MHD_HTTP_INTERNAL_SERVER_ERROR
         : status->code == SF_E_USAGE ? MHD_HTTP_BAD_REQUEST
                                      : MHD_HTTP_CONFLICT; /* what is asked for cannot be had of this scene */
}

static enum MHD_Result answer(sf_view_server *server, struct MHD_Connection *connection, const sf_view_route *route,
                              const sf_view_ask *ask)
{
  sf_view_reply reply = {0};
  server->asked = sf_seconds();
  const sf_status status = route->answer(server->options.user, ask, &reply);
  if (status.code != SF_OK) {
    drop(&reply);
    return refuse(connection, code_of(&status), status.message);
  }
  const char *type = reply.type, *file = reply.file;
  if (!reply.next)
    return queue(connection, MHD_HTTP_OK,
                 MHD_create_response_from_buffer(reply.size, reply.data, MHD_RESPMEM_MUST_FREE), type, file);
  if (server->streams >= SF_VIEW_STREAMS) {
    drop(&reply);
    return refuse(connection, MHD_HTTP_SERVICE_UNAVAILABLE, "too many pictures at a time");
  }
  return queue(connection, MHD_HTTP_OK, flowing(server, &reply), type, file);
}

static enum MHD_Result handle(void *user, struct MHD_Connection *connection, const char *url, const char *method,
                              const char *version, const char *upload, size_t *upload_size, void **state)
{
  sf_view_server *server = user;
  reading r = {.status = sf_ok()};
  (void)version, (void)upload, (void)state;
  if (*upload_size) return MHD_NO; /* nothing is taken */
  if (strcmp(method, "GET") != 0) return refuse(connection, MHD_HTTP_METHOD_NOT_ALLOWED, "GET alone is answered");
  if (!sf_view_is_own(MHD_lookup_connection_value(connection, MHD_HEADER_KIND, "Host"),
                      MHD_lookup_connection_value(connection, MHD_HEADER_KIND, "Origin")))
    return refuse(connection, MHD_HTTP_FORBIDDEN, "this host or origin is not the page's");
  sf_view_ask_begin(&r.ask);
  MHD_get_connection_values(connection, MHD_GET_ARGUMENT_KIND, read_parameter, &r);
  if (!is_token(server, r.token))
    return refuse(connection, MHD_HTTP_FORBIDDEN, "the token is missing or wrong: open the address that was printed");
  const sf_view_route *route = find_route(server, url);
  if (!route) return refuse(connection, MHD_HTTP_NOT_FOUND, "there is no such page");
  if (r.status.code != SF_OK) return refuse(connection, MHD_HTTP_BAD_REQUEST, r.status.message);
  return answer(server, connection, route, &r.ask);
}

/* ---- beginning and end ---- */

static sf_status make_token(char text[2 * TOKEN + 1])
{
  unsigned char random[TOKEN];
  if (getrandom(random, sizeof random, 0) != (ssize_t)sizeof random)
    return sf_fail(SF_E_IO, "the system gives no random numbers: %s", strerror(errno));
  for (int i = 0; i < TOKEN; i++) snprintf(text + 2 * i, 3, "%02x", random[i]);
  return sf_ok();
}

static bool make_address(const char *text, int port, struct sockaddr_storage *address, bool *six)
{
  struct sockaddr_in *v4 = (struct sockaddr_in *)address;
  struct sockaddr_in6 *v6 = (struct sockaddr_in6 *)address;
  memset(address, 0, sizeof *address);
  *six = strchr(text, ':') != NULL;
  address->ss_family = *six ? AF_INET6 : AF_INET;
  if (*six)
    v6->sin6_port = htons((uint16_t)port);
  else
    v4->sin_port = htons((uint16_t)port);
  return inet_pton(address->ss_family, text, *six ? (void *)&v6->sin6_addr : (void *)&v4->sin_addr) == 1;
}

static void no_log(void *user, const char *format, va_list arguments)
{
  (void)user, (void)format, (void)arguments;
}

static sf_status start(sf_view_server *server)
{
  const char *text = server->options.address ? server->options.address : "127.0.0.1";
  struct sockaddr_storage address;
  bool six;
  if (!make_address(text, server->options.port, &address, &six))
    return sf_fail(SF_E_USAGE, "%.60s: no address in numbers, such as 127.0.0.1", text);
  const unsigned flags = MHD_USE_THREAD_PER_CONNECTION | MHD_USE_INTERNAL_POLLING_THREAD | MHD_USE_AUTO |
                         MHD_USE_ERROR_LOG | (six ? MHD_USE_IPv6 : 0);
  errno = 0;
  server->daemon =
      MHD_start_daemon(flags, (uint16_t)server->options.port, NULL, NULL, handle, server, MHD_OPTION_EXTERNAL_LOGGER,
                       no_log, NULL, MHD_OPTION_SOCK_ADDR, (struct sockaddr *)&address, MHD_OPTION_CONNECTION_LIMIT,
                       (unsigned)SF_VIEW_CONNECTIONS, MHD_OPTION_CONNECTION_TIMEOUT, (unsigned)IDLE,
                       MHD_OPTION_CONNECTION_MEMORY_LIMIT, (size_t)MEMORY, MHD_OPTION_END);
  if (!server->daemon)
    return sf_fail(SF_E_IO, "cannot listen on %s port %d: %s", text, server->options.port,
                   errno ? strerror(errno) : "the server does not start");
  const union MHD_DaemonInfo *info = MHD_get_daemon_info(server->daemon, MHD_DAEMON_INFO_BIND_PORT);
  snprintf(server->url, sizeof server->url, "http://%s%s%s:%d/?token=%s", six ? "[" : "", text, six ? "]" : "",
           info ? info->port : server->options.port, server->token);
  return sf_ok();
}

sf_status sf_view_open(sf_view_server **server, const sf_view_options *options)
{
  *server = calloc(1, sizeof **server);
  if (!*server) return sf_fail(SF_E_MEMORY, "no memory for the server");
  (*server)->options = *options;
  sf_status status = make_token((*server)->token);
  if (status.code == SF_OK) status = start(*server);
  if (status.code != SF_OK) sf_view_close(*server), *server = NULL;
  return status;
}

const char *sf_view_url(const sf_view_server *server)
{
  return server->url;
}

double sf_view_idle(const sf_view_server *server)
{
  const double asked = server->asked;
  return asked > 0 ? sf_seconds() - asked : 1e9;
}

void sf_view_browse(const sf_view_server *server)
{
  if (!getenv("DISPLAY") && !getenv("WAYLAND_DISPLAY")) return;
  const pid_t child = fork();
  if (child == 0) {
    if (fork() == 0) {
      if (!freopen("/dev/null", "w", stderr)) _exit(1);
      execlp("xdg-open", "xdg-open", server->url, (char *)NULL);
    }
    _exit(0);
  }
  if (child > 0) waitpid(child, NULL, 0);
}

void sf_view_close(sf_view_server *server)
{
  if (!server) return;
  server->stopping = true;
  if (server->daemon) MHD_stop_daemon(server->daemon);
  free(server);
}
