#include "sim/other_dut.h"
#include "base/sha256.h"
#include "energy/energy.h"
#include "base/io.h"
#include "base/json.h"
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <libgen.h>
#include <limits.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/wait.h>
#include <unistd.h>

#define RECORD "dut.json" /* beside the program: its block */
enum { WORDS_MAX = 65536, HASH_LENGTH = 16, PATH_LENGTH = 4096, NESTED_MAX = 8 };

/* A text that identifies what is built: every word with its absolute path, and a hash of the contents of every source.
 * An include folder has a hash of the names in it, because a new file may take the place of one that was included. */
typedef struct request {
  char words[WORDS_MAX], key[2 * WORDS_MAX];
  size_t words_used, key_used;
  char root[PATH_LENGTH], build[PATH_LENGTH]; /* the source tree, and the build folder that this program stands in */
  char folder[PATH_LENGTH];
  const char *base; /* folder of relative names, NULL: the working folder */
} request;

/* Finds the build folder and the source tree. The program stands in BUILD/bin, wherever the build lies now.
 * SF_SOURCE_ROOT: path of the source tree, absolute or relative to BUILD (sim/sim.mk). */
static sf_status find_build(request *r)
{
  char program[PATH_MAX] = "", path[2 * PATH_LENGTH];
  if (readlink("/proc/self/exe", program, sizeof program - 1) < 0)
    return sf_fail(SF_E_IO, "--dut: /proc/self/exe: %s", strerror(errno));
  strcpy(r->build, dirname(dirname(program)));
  const bool absolute = SF_SOURCE_ROOT[0] == '/';
  snprintf(path, sizeof path, "%s/libspikefield.a", r->build);
  if (absolute && access(path, R_OK)) /* installed: the source tree may be there, but would build into PREFIX */
    return sf_fail(SF_E_IO, "--dut: %s is not the build folder of a source tree: no %s", r->build, path);
  snprintf(path, sizeof path, "%s/%s/sim/dut.mk", absolute ? "" : r->build, SF_SOURCE_ROOT);
  if (access(path, R_OK))
    return sf_fail(SF_E_IO, "--dut: %s is not the build folder of a source tree: no %s", r->build, path);
  snprintf(path, sizeof path, "%s/%s", absolute ? "" : r->build, SF_SOURCE_ROOT);
  if (!realpath(path, r->root)) return sf_fail(SF_E_IO, "--dut: %s: %s", path, strerror(errno));
  return sf_ok();
}

static sf_status append(char *text, size_t *used, size_t size, const char *more)
{
  const size_t length = strlen(more);
  if (*used + length + 2 > size)
    return sf_fail(SF_E_RANGE, "--dut: the list of files is longer than %d characters", WORDS_MAX);
  memcpy(text + *used, more, length);
  text[*used + length] = ' ';
  text[*used + length + 1] = '\0';
  *used += length + 1;
  return sf_ok();
}

static sf_status absolute(const request *r, const char *prefix, const char *path, char to[PATH_LENGTH])
{
  char from[2 * PATH_LENGTH], full[PATH_MAX];
  const bool below = r->base && path[0] != '/';
  snprintf(from, sizeof from, "%s%s%s", below ? r->base : "", below ? "/" : "", path);
  if (!realpath(from, full)) return sf_fail(SF_E_IO, "--dut: %s: %s", from, strerror(errno));
  if (strpbrk(full, " \t'\"$#:\\"))
    return sf_fail(SF_E_USAGE, "--dut: %s: make cannot handle a path with a space, a quote or one of $ # : \\", full);
  if (snprintf(to, PATH_LENGTH, "%s%s", prefix, full) < PATH_LENGTH) return sf_ok();
  return sf_fail(SF_E_RANGE, "--dut: %s: the path is too long", path);
}

static int is_verilog(const struct dirent *entry)
{
  static const char *const suffixes[] = {".svh", ".vh", ".sv", ".v"};
  const char *dot = strrchr(entry->d_name, '.');
  for (size_t i = 0; dot && i < sizeof suffixes / sizeof *suffixes; i++)
    if (!strcmp(dot, suffixes[i])) return 1;
  return 0;
}

static sf_status add_names(request *r, const char *folder)
{
  char text[65 + NAME_MAX + 1], hash[65] = "";
  struct dirent **entry;
  const int n = scandir(folder, &entry, is_verilog, alphasort);
  if (n < 0) return sf_fail(SF_E_IO, "--dut: %s: %s", folder, strerror(errno));
  for (int i = 0; i < n; i++) {
    sf_sha256(text, (size_t)snprintf(text, sizeof text, "%s%s", hash, entry[i]->d_name), hash);
    free(entry[i]);
  }
  free(entry);
  return append(r->key, &r->key_used, sizeof r->key, hash);
}

static sf_status add_word(request *r, const char *word)
{
  char full[PATH_LENGTH], hash[65];
  const bool plus = strncmp(word, "+incdir+", 8) == 0, letter = strncmp(word, "-I", 2) == 0 && word[2];
  if (plus || letter) {
    SF_TRY(absolute(r, plus ? "+incdir+" : "-I", word + (plus ? 8 : 2), full));
    SF_TRY(append(r->key, &r->key_used, sizeof r->key, full));
    SF_TRY(add_names(r, strchr(full, '/')));
    return append(r->words, &r->words_used, sizeof r->words, full);
  }
  if (word[0] == '-' || word[0] == '+') {
    if (strpbrk(word, "'\"$#\\;&|<>`()"))
      return sf_fail(SF_E_USAGE, "--dut: %s: make cannot handle a quote or one of $ # \\ ; & | < > ` ( )", word);
    SF_TRY(append(r->key, &r->key_used, sizeof r->key, word));
    return append(r->words, &r->words_used, sizeof r->words, word);
  }
  SF_TRY(absolute(r, "", word, full));
  SF_TRY(sf_sha256_file(full, hash));
  SF_TRY(append(r->key, &r->key_used, sizeof r->key, hash));
  SF_TRY(append(r->key, &r->key_used, sizeof r->key, full));
  return append(r->words, &r->words_used, sizeof r->words, full);
}

/* ---- lists of files: -f LIST, names below the working folder, and -F LIST, names below the list's ---- */

/* A comment begins where a word might. */
static void blank_comments(char *text)
{
  bool inside = false, begins = true;
  for (; *text; text++) {
    if (begins && (*text == '#' || (text[0] == '/' && text[1] == '/'))) inside = true;
    if (*text == '\n') inside = false;
    if (inside) *text = ' ';
    begins = strchr(" \t\r\n", *text) != NULL;
  }
}

static sf_status add_words(request *r, char *text, int nested);

static sf_status add_list(request *r, const char *list, bool below_list, int nested)
{
  char full[PATH_LENGTH], folder[PATH_LENGTH], *text;
  size_t size;
  const char *base = r->base;
  if (nested == NESTED_MAX) return sf_fail(SF_E_FORMAT, "--dut: %s: lists within lists, %d deep", list, nested);
  SF_TRY(absolute(r, "", list, full));
  SF_TRY(sf_read_file(full, WORDS_MAX, &text, &size));
  strcpy(folder, full);
  r->base = below_list ? dirname(folder) : NULL;
  blank_comments(text);
  sf_status status = add_words(r, text, nested + 1);
  r->base = base;
  free(text);
  if (status.code != SF_E_IO || below_list) return status;
  return sf_fail(status.code, "%.250s (names in -f %.60s are below the working folder; -F takes them below the list's)",
                 status.message, list);
}

static sf_status add_words(request *r, char *text, int nested)
{
  static const char *const blanks = " \t\r\n";
  char *rest = NULL;
  for (char *word = strtok_r(text, blanks, &rest); word; word = strtok_r(NULL, blanks, &rest)) {
    const bool list = !strcmp(word, "-f") || !strcmp(word, "-F");
    const char *name = list ? strtok_r(NULL, blanks, &rest) : NULL;
    if (list && !name) return sf_fail(SF_E_USAGE, "--dut: %s names no list", word);
    SF_TRY(list ? add_list(r, name, word[1] == 'F', nested) : add_word(r, word));
  }
  return sf_ok();
}

static sf_status read_request(request *r, const char *program, const char *files, const char *top)
{
  char hash[65];
  char *text = strdup(files);
  if (!text) return sf_fail(SF_E_MEMORY, "--dut: no memory");
  sf_status status = append(r->key, &r->key_used, sizeof r->key, program);
  if (status.code == SF_OK) status = append(r->key, &r->key_used, sizeof r->key, top);
  if (status.code == SF_OK) status = add_words(r, text, 0);
  free(text);
  SF_TRY(status);
  if (!r->words_used) return sf_fail(SF_E_USAGE, "--dut names no file");
  sf_sha256(r->key, r->key_used, hash);
  if (snprintf(r->folder, sizeof r->folder, "%s/dut/%.*s", r->build, HASH_LENGTH, hash) < PATH_LENGTH) return sf_ok();
  return sf_fail(SF_E_RANGE, "--dut: %s: the path is too long", r->build);
}

/* ---- building ---- */

/* In the child. Output of make and Verilator goes to standard error, because standard output has the report. */
static void become_make(const request *r, const char *program, const char *top)
{
  char files[WORDS_MAX + 8], what[32], module[256 + 16], out[PATH_LENGTH + 16], in[PATH_LENGTH + 16];
  snprintf(files, sizeof files, "DUT=%s", r->words);
  snprintf(what, sizeof what, "DUT_PROGRAM=%s", program);
  snprintf(module, sizeof module, "DUT_TOP=%s", top);
  snprintf(out, sizeof out, "DUT_OUT=%s", r->folder);
  snprintf(in, sizeof in, "B=%s", r->build);
  unsetenv("MAKEFLAGS");
  unsetenv("MAKELEVEL");
  dup2(STDERR_FILENO, STDOUT_FILENO);
  execlp("make", "make", "-s", "-C", r->root, in, files, what, module, out, "dut", (char *)NULL);
  _exit(127);
}

static sf_status run_make(const request *r, const char *program, const char *top)
{
  int state = 0;
  const pid_t child = fork();
  if (child < 0) return sf_fail(SF_E_IO, "--dut: cannot start make: %s", strerror(errno));
  if (child == 0) become_make(r, program, top);
  while (waitpid(child, &state, 0) < 0)
    if (errno != EINTR) return sf_fail(SF_E_IO, "--dut: %s", strerror(errno));
  if (WIFEXITED(state) && WEXITSTATUS(state) == 0) return sf_ok();
  if (WIFSIGNALED(state)) return sf_fail(SF_E_STOPPED, "--dut: the build was stopped by signal %d", WTERMSIG(state));
  if (WEXITSTATUS(state) == 127) return sf_fail(SF_E_IO, "--dut: make is not installed");
  return sf_fail(SF_E_FORMAT, "--dut: module %s does not build; Verilator's messages are above", top);
}

/* Written for that program, which has to know which block it has. */
static sf_status record(const request *r, const char *top)
{
  char path[PATH_LENGTH + 16];
  snprintf(path, sizeof path, "%s/" RECORD, r->folder);
  if (access(path, F_OK) == 0) return sf_ok();
  cJSON *json = cJSON_CreateObject();
  cJSON_AddStringToObject(json, "files", r->words);
  cJSON_AddStringToObject(json, "top", top);
  cJSON_AddStringToObject(json, "sources", strrchr(r->folder, '/') + 1);
  const sf_status status = sf_json_save(json, path);
  cJSON_Delete(json);
  return status;
}

/* Two runs of the same sources wait for each other. */
static sf_status build(const request *r, const char *program, const char *top)
{
  char path[PATH_LENGTH + 16];
  SF_TRY(sf_make_dir(r->folder));
  snprintf(path, sizeof path, "%s/lock", r->folder);
  const int lock = open(path, O_RDWR | O_CREAT | O_CLOEXEC, 0644);
  if (lock < 0 || flock(lock, LOCK_EX)) return sf_fail(SF_E_IO, "%s: %s", path, strerror(errno));
  sf_status status = run_make(r, program, top);
  if (status.code == SF_OK) status = record(r, top);
  close(lock);
  return status;
}

/* ---- running ---- */

static bool is_option(const char *argument, const char *name, bool *with_value)
{
  const size_t length = strlen(name);
  *with_value = false;
  if (strncmp(argument, name, length) != 0) return false;
  *with_value = argument[length] == '=';
  return *with_value || argument[length] == '\0';
}

static void leave_out(char **argv)
{
  char **to = argv;
  bool joined;
  while (*argv) {
    if (is_option(*argv, "--dut", &joined) || is_option(*argv, "--dut-top", &joined))
      argv += joined || !argv[1] ? 1 : 2;
    else
      *to++ = *argv++;
  }
  *to = NULL;
}

static sf_status check_name(const char *top)
{
  static const char *const letters = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_";
  if (top[0] && strlen(top) < 256 && strspn(top, letters) == strlen(top)) return sf_ok();
  return sf_fail(SF_E_USAGE, "--dut-top: '%s' is not the name of a module", top);
}

sf_status sf_other_dut_run(const char *program, const char *files, const char *top, char **argv)
{
  char path[PATH_LENGTH + 16];
  SF_TRY(check_name(top));
  request *r = calloc(1, sizeof *r);
  if (!r) return sf_fail(SF_E_MEMORY, "--dut: no memory");
  sf_status status = find_build(r);
  if (status.code == SF_OK) status = read_request(r, program, files, top);
  if (status.code == SF_OK) status = build(r, program, top);
  snprintf(path, sizeof path, "%s/%s", r->folder, program);
  free(r);
  SF_TRY(status);
  leave_out(argv);
  execv(path, argv);
  return sf_fail(SF_E_IO, "%s: %s", path, strerror(errno));
}

/* ---- which block a program has, a difference was of ---- */

sf_status sf_other_dut_own(cJSON **dut)
{
  char program[PATH_MAX] = "", path[PATH_MAX + 16];
  *dut = NULL;
  if (readlink("/proc/self/exe", program, sizeof program - 1) < 0)
    return sf_fail(SF_E_IO, "/proc/self/exe: %s", strerror(errno));
  snprintf(path, sizeof path, "%s/" RECORD, dirname(program));
  return access(path, F_OK) ? sf_ok() : sf_json_load(path, dut);
}

static bool same_text(const cJSON *a, const cJSON *b, const char *key)
{
  const char *one = sf_json_text(a, key), *other = sf_json_text(b, key);
  return one && other && !strcmp(one, other);
}

const char *sf_other_dut_departs(const cJSON *own, const cJSON *dut)
{
  if (!own && !dut) return NULL;
  if (!dut) return "the file is of the built-in block, this is another one";
  if (!own || !same_text(own, dut, "files") || !same_text(own, dut, "top")) return "the file is of another block";
  return same_text(own, dut, "sources") ? NULL : "the block's sources have changed since the file was written";
}

static sf_status run_recorded(const cJSON *dut, const char *path, char **argv)
{
  const char *files = sf_json_text(dut, "files"), *top = sf_json_text(dut, "top");
  if (!files || !top) return sf_fail(SF_E_FORMAT, "%s: 'dut' has no text 'files' or no text 'top'", path);
  const sf_status status = sf_other_dut_run("sf_cosim", files, top, argv);
  return sf_fail(status.code, "%.100s: the block that differed: %.250s", path, status.message);
}

sf_status sf_other_dut_replay(const char *path, char **argv)
{
  cJSON *own, *replay;
  SF_TRY(sf_other_dut_own(&own));
  cJSON_Delete(own);
  if (own) return sf_ok(); /* the caller has chosen this program */
  SF_TRY(sf_json_load(path, &replay));
  const cJSON *dut = sf_json_get(replay, "dut");
  const sf_status status = dut ? run_recorded(dut, path, argv) : sf_ok();
  cJSON_Delete(replay);
  return status;
}
