/* The filler of the report's template: what it writes, and that it names file, line and cause of what is wrong. */
#include "ck_run.h"
#include "base/template.h"

static const char tree[] =
    "{\"n\":3,\"zero\":0,\"none\":null,\"no\":false,\"text\":\"a<b & c\",\"key\":\"two\",\"big\":[],"
    "\"list\":[{\"name\":\"one\",\"v\":[10,11]},{\"name\":\"two\",\"v\":[20,21]}],"
    "\"by\":{\"one\":\"first\",\"two\":\"second\"}}";

static sf_status put_twice(FILE *out, const sf_template_value *value, void *user)
{
  *(int *)user += 1;
  fprintf(out, "[%s=%g]", value->path, 2 * sf_json_real(value->node));
  return sf_ok();
}

static sf_status put_two(FILE *out, const sf_template_value *value, void *user)
{
  (void)user;
  fprintf(out, "%g:%g", sf_json_real(value[0].node), sf_json_real(value[1].node));
  return sf_ok();
}

static sf_status put_mark(FILE *out, const sf_template_value *value, void *user)
{
  (void)value, (void)user;
  fputs("!", out);
  return sf_ok();
}

static sf_status put_fault(FILE *out, const sf_template_value *value, void *user)
{
  (void)out, (void)value, (void)user;
  return sf_fail(SF_E_MEMORY, "no memory");
}

static const sf_template_call calls[] = {
    {"twice", 1, put_twice}, {"two", 2, put_two}, {"mark", 0, put_mark}, {"fault", 0, put_fault}, {NULL, 0, NULL}};

/* What the text becomes; free it. */
static char *filled(const char *text, sf_status *status)
{
  char *result;
  size_t size;
  int called = 0;
  cJSON *json = cJSON_Parse(tree);
  ck_assert_ptr_nonnull(json);
  cJSON_AddRawToObject(json, "digits", "18446744073709551615");
  cJSON_AddRawToObject(json, "almost", "18446744073709551614");
  FILE *out = open_memstream(&result, &size);
  const sf_template t = {"page.html", text, json, calls, &called};
  *status = sf_template_fill(out, &t);
  fclose(out);
  cJSON_Delete(json);
  return result;
}

static const struct {
  const char *text, *result;
} good[] = {
    {"", ""},
    {"plain } { text\n", "plain } { text\n"},
    {"{{n}} {{text}} {{digits}}", "3 a&lt;b &amp; c 18446744073709551615"},
    {"{{twice n}}{{ twice\n  list[1].v[0] }}{{mark}}{{two n zero}}", "[n=6][list[1].v[0]=40]!3:0"},
    {"{{#each list as l}}{{index l}}{{number l}}{{l.name}}{{#each l.v as v}} {{twice v}}{{/each}};{{/each}}",
     "01one [list[0].v[0]=20] [list[0].v[1]=22];12two [list[1].v[0]=40] [list[1].v[1]=42];"},
    {"{{#each by as b}}{{b}} {{#equal @b \"two\"}}2{{else}}-{{/equal}} {{/each}}", "first - second 2 "},
    {"{{#each list as l}}{{by.(l.name)}}{{list[@l].v[(zero)]}}{{/each}} {{by.(key)}}", "first10second20 second"},
    {"{{#each big as b}}{{nosuch}}{{/each}}empty", "empty"},
    {"{{#if n}}a{{else}}b{{/if}}{{#if zero}}a{{else}}b{{/if}}{{#if none}}a{{else}}b{{/if}}{{#if no}}a{{else}}b{{/if}}"
     "{{#if big}}a{{else}}b{{/if}}{{#if digits}}a{{/if}}{{#if text}}a{{/if}}",
     "abbbbaa"},
    {"{{#has zero}}a{{/has}}{{#has none}}b{{/has}}{{#has nosuch}}c{{else}}d{{/has}}", "ad"},
    {"{{#equal n 3 3}}a{{/equal}}{{#equal n 3 4}}b{{/equal}}{{#equal digits digits}}c{{/equal}}"
     "{{#equal digits almost}}d{{/equal}}",
     "ac"},
    {"{{#if zero}}{{nosuch}}{{#each nosuch as x}}{{x}}{{/each}}{{#equal nosuch 1}}{{else}}{{nosuch}}{{/equal}}{{/if}}x",
     "x"},
    {"a\n  {{#if n}}\nb\n{{else}}\nc\n  {{/if}}\nd {{#if n}}e{{/if}}\nf\n", "a\nb\nd e\nf\n"},
};

LOOP_TEST(texts, COUNT(good))
{
  sf_status status;
  char *result = filled(good[_i].text, &status);
  ck_assert_msg(status.code == SF_OK, "%s: %s", good[_i].text, status.message);
  ck_assert_str_eq(result, good[_i].result);
  free(result);
}

static const struct {
  const char *text, *line, *cause;
} bad[] = {
    {"\n\n{{nosuch}}", "page.html, line 3", "nosuch"},
    {"{{n}}\n{{list[2].name}}", "line 2", "list[2].name"},
    {"\n{{list[0].nmae}}", "line 2", "nmae"},
    {"{{nosuch n}}", "line 1", "nosuch"},
    {"{{twice n n}}", "line 1", "twice"},
    {"{{twice}}", "line 1", "twice"},
    {"{{list}}", "line 1", "list"},
    {"\n{{#each n as x}}{{/each}}", "line 2", "n"},
    {"{{#each list}}{{/each}}", "line 1", "each"},
    {"{{#each list as l}}\n{{l.nosuch}}{{/each}}", "line 2", "list[0].nosuch"},
    {"{{#each list as l}}{{else}}{{/each}}", "line 1", "else"},
    {"\n{{#if n}}x", "line 2", "#if"},
    {"{{#if n}}\n{{/has}}", "line 2", "/has"},
    {"{{#if zero}}\n{{#has n}}\n{{/if}}", "line 3", "/if"},
    {"x\n{{/if}}", "line 2", "/if"},
    {"{{else}}", "line 1", "else"},
    {"{{#if n}}{{else}}{{else}}{{/if}}", "line 1", "else"},
    {"{{#unless n}}{{/unless}}", "line 1", "unless"},
    {"{{#if nosuch}}{{/if}}", "line 1", "nosuch"},
    {"{{#equal n}}{{/equal}}", "line 1", "equal"},
    {"{{by.(key}}", "line 1", "(key"},
    {"{{list[@l]}}", "line 1", "l"},
    {"{{index l}}", "line 1", "l"},
    {"\n{{n", "line 2", "malformed"},
    {"{{}}", "line 1", "empty"},
    {"{{#equal n \"3}}{{/equal}}", "line 1", "malformed"},
};

LOOP_TEST(faults, COUNT(bad))
{
  sf_status status;
  free(filled(bad[_i].text, &status));
  ck_assert_msg(status.code == SF_E_FORMAT, "not seen: %s", bad[_i].text);
  ck_assert_msg(strstr(status.message, bad[_i].line) && strstr(status.message, bad[_i].cause), "%s: %s", bad[_i].text,
                status.message);
}

/* What a function reports is what is reported; too deep and too long is said. */
TEST(limits)
{
  sf_status status;
  char text[2048] = "";
  free(filled("{{fault}}", &status));
  ck_assert_int_eq(status.code, SF_E_MEMORY);
  for (int i = 0; i < 9; i++) strcat(text, "{{#each big as b}}");
  for (int i = 0; i < 9; i++) strcat(text, "{{/each}}");
  free(filled(text, &status));
  ck_assert_int_eq(status.code, SF_OK);
  text[0] = 0;
  for (int i = 0; i < 9; i++) strcat(text, "{{#each list as b}}");
  for (int i = 0; i < 9; i++) strcat(text, "{{/each}}");
  free(filled(text, &status));
  ck_assert_int_eq(status.code, SF_E_FORMAT);
  memset(text, 'x', 200);
  memcpy(text, "{{", 2), memcpy(text + 198, "}}", 3);
  free(filled(text, &status));
  ck_assert_int_eq(status.code, SF_E_FORMAT);
}

TEST(values_by_path)
{
  static const char *const nowhere[] = {"nosuch",        "list[2]", "list.name",    "n.m",
                                        "list[0].v[-1]", "[0]x",    "list[0]..name"};
  cJSON *json = cJSON_Parse(tree);
  cJSON_AddRawToObject(json, "digits", "18446744073709551615");
  ck_assert_ptr_eq(sf_json_at(json, ""), json);
  ck_assert_double_eq(sf_json_real(sf_json_at(json, "list[1].v[0]")), 20);
  ck_assert_uint_eq(sf_json_u64(sf_json_at(json, "n")), 3);
  ck_assert_uint_eq(sf_json_u64(sf_json_at(json, "digits")), UINT64_MAX);
  ck_assert_double_eq(sf_json_real(sf_json_at(json, "digits")), 18446744073709551616.0);
  ck_assert_uint_eq(sf_json_u64(sf_json_at(json, "text")), 0);
  ck_assert(sf_json_real(sf_json_at(json, "none")) != sf_json_real(sf_json_at(json, "none")));
  for (int i = 0; i < COUNT(nowhere); i++) ck_assert_msg(!sf_json_at(json, nowhere[i]), "there is a %s", nowhere[i]);
  cJSON_Delete(json);
}
