#include "base/template.h"
#include "base/text.h"
#include <string.h>

/* ---- the text being filled ---- */

enum { NAME = 32, WORDS = 8, WORD = 160, DEPTH = 8 };

typedef struct loop {
  char name[NAME], path[SF_TEMPLATE_PATH], key[NAME];
  int index;
} loop;

typedef struct filler {
  const sf_template *t;
  FILE *out;
  const char *at;
  loop loop[DEPTH];
  int loops;
  bool dead; /* inside of a branch that is not taken */
} filler;

/* Words of one tag: "#each", "counts.layers", "as", "l". */
typedef struct tag {
  const char *start;
  char word[WORDS][WORD];
  int words;
} tag;

static sf_status wrong(const filler *f, const char *at, const char *what, const char *name)
{
  int line = 1;
  for (const char *c = f->t->text; c < at; c++) line += *c == '\n';
  return sf_fail(SF_E_FORMAT, "%s, line %d: %s%s%s", f->t->name, line, what, *name ? " " : "", name);
}

static const loop *find_loop(const filler *f, const char *name, size_t length)
{
  for (int i = f->loops - 1; i >= 0; i--)
    if (strlen(f->loop[i].name) == length && !memcmp(f->loop[i].name, name, length)) return &f->loop[i];
  return NULL;
}

/* ---- paths ---- */

static sf_status value_of(const filler *f, const char *at, const char *word, bool needed, sf_template_value *value);

static bool append(char path[SF_TEMPLATE_PATH], const char *text, size_t length)
{
  const size_t used = strlen(path);
  if (used + length >= SF_TEMPLATE_PATH) return false;
  memcpy(path + used, text, length);
  path[used + length] = 0;
  return true;
}

static bool append_text(char path[SF_TEMPLATE_PATH], const cJSON *node)
{
  char digits[32];
  const char *text = cJSON_GetStringValue(node);
  if (!text) snprintf(digits, sizeof digits, "%.0f", sf_json_real(node)), text = digits;
  return append(path, text, strlen(text));
}

/* One piece of a path, from *word on: a name in front, @name, (path), or as it stands. */
static sf_status expand_piece(const filler *f, const char *at, const char **word, bool front, char *path)
{
  static const char ends[] = ".[]()@";
  const char *from = *word;
  bool fits;
  if (*from == '(') {
    sf_template_value inner;
    char text[WORD];
    const size_t length = strcspn(from + 1, ")");
    if (from[length + 1] != ')') return wrong(f, at, "no ')' in", from);
    snprintf(text, sizeof text, "%.*s", (int)length, from + 1);
    SF_TRY(value_of(f, at, text, true, &inner));
    fits = append_text(path, inner.node);
    *word += length + 2;
  } else if (*from == '@' || front) {
    const char *name = from + (*from == '@');
    const size_t length = strcspn(name, ends);
    const loop *l = find_loop(f, name, length);
    if (*from == '@' && !l) return wrong(f, at, "no loop named", name);
    const char *text = *from == '@' ? l->key : l ? l->path : name;
    fits = append(path, text, *from == '@' || l ? strlen(text) : length);
    *word = name + length;
  } else {
    const size_t length = 1 + strcspn(from + 1, ends);
    fits = append(path, from, length);
    *word += length;
  }
  return fits ? sf_ok() : wrong(f, at, "a path is too long:", path);
}

static sf_status value_of(const filler *f, const char *at, const char *word, bool needed, sf_template_value *value)
{
  value->path[0] = 0;
  for (const char *c = word; *c;) SF_TRY(expand_piece(f, at, &c, c == word, value->path));
  value->node = sf_json_at(f->t->json, value->path);
  if (!value->node && needed) return wrong(f, at, "no value", value->path);
  return sf_ok();
}

/* ---- tags ---- */

static sf_status read_tag(filler *f, tag *g)
{
  const char *c = f->at + 2;
  *g = (tag){.start = f->at};
  for (;;) {
    while (*c == ' ' || *c == '\n') c++;
    if (c[0] == '}' && c[1] == '}') break;
    const size_t length = *c == '"' ? 2 + strcspn(c + 1, "\"") : strcspn(c, " \n}");
    if (!*c || length == 0 || length >= WORD || g->words == WORDS || (*c == '"' && c[length - 1] != '"'))
      return wrong(f, g->start, "a tag is malformed", "");
    memcpy(g->word[g->words], c, length);
    g->word[g->words++][length] = 0;
    c += length;
  }
  f->at = c + 2;
  return g->words ? sf_ok() : wrong(f, g->start, "an empty tag", "");
}

static bool of_section(const tag *g)
{
  return g->word[0][0] == '#' || g->word[0][0] == '/' || !strcmp(g->word[0], "else");
}

/* A tag of a section that has its line to itself takes the line away: f->at moves behind it. */
static bool alone(filler *f, const tag *g)
{
  const char *before = g->start, *after = f->at + strspn(f->at, " ");
  while (before > f->t->text && before[-1] == ' ') before--;
  if (!of_section(g) || *after != '\n' || (before > f->t->text && before[-1] != '\n')) return false;
  f->at = after + 1;
  return true;
}

static sf_status write_plain(const filler *f, const tag *g, const sf_template_value *value)
{
  const char *text = cJSON_GetStringValue(value->node);
  if (cJSON_IsRaw(value->node) || text)
    sf_xml_escape(f->out, text ? text : value->node->valuestring);
  else if (cJSON_IsNumber(value->node))
    fprintf(f->out, "%.17g", value->node->valuedouble);
  else
    return wrong(f, g->start, "no text or number at", value->path);
  return sf_ok();
}

static sf_status write_value(const filler *f, const tag *g)
{
  sf_template_value value[SF_TEMPLATE_VALUES];
  const char *name = g->word[0];
  if (!strcmp(name, "index") || !strcmp(name, "number")) {
    const loop *l = find_loop(f, g->word[1], strlen(g->word[1]));
    if (!l) return wrong(f, g->start, "no loop named", g->word[1]);
    fprintf(f->out, "%d", l->index + (*name == 'n'));
    return sf_ok();
  }
  for (const sf_template_call *call = f->t->call; call->name; call++) {
    if (strcmp(call->name, name) || call->values != g->words - 1) continue;
    for (int i = 0; i < call->values; i++) SF_TRY(value_of(f, g->start, g->word[1 + i], true, &value[i]));
    return call->write(f->out, value, f->t->user);
  }
  if (g->words > 1) return wrong(f, g->start, "no such function, or not of so many values:", name);
  SF_TRY(value_of(f, g->start, name, true, value));
  return write_plain(f, g, value);
}

/* ---- sections ---- */

static sf_status fill(filler *f, const tag *opened, tag *closed);

static bool truth(const cJSON *node)
{
  const char *text = cJSON_GetStringValue(node);
  if (text) return *text != 0;
  if (cJSON_IsRaw(node) || cJSON_IsNumber(node)) return sf_json_real(node) < 0 || sf_json_real(node) > 0;
  return cJSON_IsTrue(node) || cJSON_GetArraySize(node) > 0;
}

/* A path or a literal, as text: what "equal" compares. */
static sf_status text_of(const filler *f, const tag *g, const char *word, char text[WORD])
{
  sf_template_value value;
  if (*word == '"' || (*word >= '0' && *word <= '9')) {
    snprintf(text, WORD, "%.*s", (int)(*word == '"' ? strlen(word) - 2 : strlen(word)), word + (*word == '"'));
    return sf_ok();
  }
  if (*word == '@') {
    const loop *l = find_loop(f, word + 1, strlen(word + 1));
    if (!l) return wrong(f, g->start, "no loop named", word + 1);
    snprintf(text, WORD, "%s", l->key);
    return sf_ok();
  }
  SF_TRY(value_of(f, g->start, word, true, &value));
  const char *string = cJSON_GetStringValue(value.node);
  if (string || cJSON_IsRaw(value.node))
    snprintf(text, WORD, "%s", string ? string : value.node->valuestring);
  else
    snprintf(text, WORD, "%.17g", sf_json_real(value.node));
  return sf_ok();
}

static sf_status holds(filler *f, const tag *g, bool *yes)
{
  sf_template_value value;
  char first[WORD], other[WORD];
  *yes = false;
  if (f->dead) return sf_ok();
  if (!strcmp(g->word[0], "#equal")) {
    if (g->words < 3) return wrong(f, g->start, "equal takes two values", "");
    SF_TRY(text_of(f, g, g->word[1], first));
    *yes = true;
    for (int i = 2; i < g->words; i++) {
      SF_TRY(text_of(f, g, g->word[i], other));
      *yes = *yes && !strcmp(first, other);
    }
    return sf_ok();
  }
  const bool has = !strcmp(g->word[0], "#has");
  if (g->words != 2 || (!has && strcmp(g->word[0], "#if"))) return wrong(f, g->start, "no such section:", g->word[0]);
  SF_TRY(value_of(f, g->start, g->word[1], !has, &value));
  *yes = has ? value.node && !cJSON_IsNull(value.node) : truth(value.node);
  return sf_ok();
}

static sf_status choice(filler *f, const tag *g)
{
  const bool dead = f->dead;
  bool yes;
  tag end;
  SF_TRY(holds(f, g, &yes));
  f->dead = dead || !yes;
  SF_TRY(fill(f, g, &end));
  if (!strcmp(end.word[0], "else")) {
    f->dead = dead || yes;
    SF_TRY(fill(f, g, &end));
    if (!strcmp(end.word[0], "else")) return wrong(f, end.start, "a second else", "");
  }
  f->dead = dead;
  return sf_ok();
}

static sf_status member(filler *f, const tag *g, const sf_template_value *list, const cJSON *node, int index)
{
  loop *l = &f->loop[f->loops];
  const bool array = cJSON_IsArray(list->node);
  l->index = index;
  memcpy(l->name, g->word[3], strlen(g->word[3]) + 1);
  if (array)
    snprintf(l->key, NAME, "%d", index);
  else
    snprintf(l->key, NAME, "%s", node->string);
  const int n = snprintf(l->path, sizeof l->path, array ? "%s[%s]" : "%s.%s", list->path, l->key);
  return n < (int)sizeof l->path ? sf_ok() : wrong(f, g->start, "a path is too long:", list->path);
}

static sf_status each(filler *f, const tag *g)
{
  const char *start = f->at;
  const bool dead = f->dead;
  const cJSON *node;
  sf_template_value list = {.node = NULL};
  int index = 0;
  tag end;
  if (g->words != 4 || strcmp(g->word[2], "as") || f->loops == DEPTH)
    return wrong(f, g->start, "each PATH as NAME", "");
  if (!dead) SF_TRY(value_of(f, g->start, g->word[1], true, &list));
  if (!dead && !cJSON_IsArray(list.node) && !cJSON_IsObject(list.node))
    return wrong(f, g->start, "neither list nor object:", list.path);
  cJSON_ArrayForEach(node, list.node)
  {
    SF_TRY(member(f, g, &list, node, index++));
    f->loops++, f->at = start;
    SF_TRY(fill(f, g, &end));
    f->loops--;
  }
  f->dead = dead || index == 0;
  if (index == 0) SF_TRY(fill(f, g, &end));
  f->dead = dead;
  return strcmp(end.word[0], "else") ? sf_ok() : wrong(f, end.start, "else in each", "");
}

/* To the tag that ends `opened` (*closed: else or its end), or to the end of the text. */
static sf_status fill(filler *f, const tag *opened, tag *closed)
{
  for (;;) {
    const char *next = strstr(f->at, "{{");
    const size_t length = next ? (size_t)(next - f->at) : strlen(f->at);
    const char *from = f->at;
    tag g;
    f->at += length;
    if (next) SF_TRY(read_tag(f, &g));
    size_t shown = length;
    if (next && alone(f, &g))
      while (shown > 0 && from[shown - 1] == ' ') shown--;
    if (!f->dead) fwrite(from, 1, shown, f->out);
    if (!next) return opened ? wrong(f, opened->start, "no end of", opened->word[0]) : sf_ok();
    if (!strcmp(g.word[0], "else") || g.word[0][0] == '/') {
      if (!opened || (g.word[0][0] == '/' && strcmp(g.word[0] + 1, opened->word[0] + 1)))
        return wrong(f, g.start, "nothing to end with", g.word[0]);
      *closed = g;
      return sf_ok();
    }
    if (!strcmp(g.word[0], "#each"))
      SF_TRY(each(f, &g));
    else if (g.word[0][0] == '#')
      SF_TRY(choice(f, &g));
    else if (!f->dead)
      SF_TRY(write_value(f, &g));
  }
}

sf_status sf_template_fill(FILE *out, const sf_template *t)
{
  filler f = {.t = t, .out = out, .at = t->text};
  return fill(&f, NULL, NULL);
}
