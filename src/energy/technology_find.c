/* Technology files by name, beside the program. */
#include "energy/ledger.h"
#include <dirent.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static int has_prices(const struct dirent *entry)
{
  const size_t n = strlen(entry->d_name);
  return n > 5 && !strcmp(entry->d_name + n - 5, ".tech");
}

static sf_status unknown_technology(const char *name, const char *folder)
{
  struct dirent **entry = NULL;
  char names[100] = "";
  const int n = scandir(folder, &entry, has_prices, alphasort);
  for (int i = 0; i < n; i++) {
    const size_t used = strlen(names);
    snprintf(names + used, sizeof names - used, "%s%.*s", i ? ", " : "", (int)strlen(entry[i]->d_name) - 5,
             entry[i]->d_name);
    free(entry[i]);
  }
  free(entry);
  return sf_fail(SF_E_IO, "--tech %.60s: no such file, and no %.200s/%.60s.tech; names there: %s (or give a file)",
                 name, folder, name, *names ? names : "none");
}

sf_status sf_technology_find(sf_technology *technology, const char *name)
{
  char path[4096 + 64];
  if (strchr(name, '/') || access(name, F_OK) == 0) return sf_technology_load(technology, name);
  const ssize_t n = readlink("/proc/self/exe", path, 4096);
  if (n <= 0) return sf_fail(SF_E_IO, "--tech %s: /proc/self/exe: cannot find the program's folder", name);
  path[n] = 0;
  for (int up = 0; up < 2 && strrchr(path, '/'); up++) *strrchr(path, '/') = 0;
  const size_t folder = strlen(path);
  snprintf(path + folder, sizeof path - folder, "/share/spikefield/tech/%.60s.tech", name);
  if (access(path, F_OK) == 0) return sf_technology_load(technology, path);
  *strrchr(path, '/') = 0;
  return unknown_technology(name, path);
}
