/* Two audits side by side, as a gnuplot script. */
#include "report/plot.h"
#include "base/io.h"
#include "base/json.h"
#include <string.h>

sf_status sf_plot_name(const char *path, char name[256])
{
  const char *slash = strrchr(path, '/'), *file = slash ? slash + 1 : path;
  const size_t length = strlen(file);
  if (length < 4 || length > 250 || strcmp(file + length - 3, ".gp") != 0 || strpbrk(file, "'\\\n"))
    return sf_fail(SF_E_USAGE, "--plot %s: expected NAME.gp, a gnuplot script that writes NAME.svg", path);
  snprintf(name, 256, "%.*s", (int)(length - 3), file);
  return sf_ok();
}

static void quoted(char *to, size_t size, const cJSON *text)
{
  sf_plot_quote(to, size, cJSON_IsString(text) ? text->valuestring : "");
}

sf_status sf_plot_comparison(const char *path, const cJSON *comparison)
{
  char name[256], a[128], b[128];
  SF_TRY(sf_plot_name(path, name));
  const cJSON *ledgers = sf_json_get(comparison, "energies_mj_per_view"), *last = NULL, *item;
  cJSON_ArrayForEach(item, ledgers) last = item;
  if (sf_json_get(ledgers, "neuron")) last = sf_json_get(ledgers, "neuron"); /* the ledger with everything */
  sf_writer writer;
  SF_TRY(sf_writer_open(&writer, path));
  FILE *out = writer.file;
  sf_plot_head(out, name, "Energy of a view by kind, everything counted", "", "mJ per view",
               "outside top center horizontal");
  quoted(a, sizeof a, sf_json_get(comparison, "a"));
  quoted(b, sizeof b, sf_json_get(comparison, "b"));
  fprintf(out, "set style data histograms\nset style histogram clustered gap 1\nset style fill solid border -1\n"
               "set xtics rotate by -20\nset yrange [0:]\n$parts << EOD\n");
  cJSON_ArrayForEach(item, sf_json_get(last, "parts"))
  {
    char kind[64];
    quoted(kind, sizeof kind, sf_json_get(item, "name"));
    fprintf(out, "\"%s\" %.9g %.9g\n", kind, sf_json_number(item, "a"), sf_json_number(item, "b"));
  }
  fprintf(out,
          "EOD\nplot $parts using 2:xtic(1) linecolor '%s' title 'A: %s', '' using 3 linecolor '%s' title 'B: %s'\n",
          sf_plot_colour[0], a, sf_plot_colour[1], b);
  SF_TRY(sf_writer_commit(&writer));
  fprintf(stderr, "wrote %s; gnuplot makes %s.svg of it\n", path, name);
  return sf_ok();
}
