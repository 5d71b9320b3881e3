/* Runs a fuzzing target over files and folders of files, without libFuzzer. Prints how many inputs there were. */
#include "fuzz.h"
#include <dirent.h>
#include <sys/stat.h>

static int replay_file(const char *path)
{
  FILE *file = fopen(path, "rb");
  struct stat info;
  if (!file || fstat(fileno(file), &info)) {
    perror(path);
    exit(1);
  }
  /* Exactly as long as the input, so that an address sanitizer sees the byte behind it. */
  const size_t size = (size_t)info.st_size;
  uint8_t *data = malloc(size ? size : 1);
  if (!data || fread(data, 1, size, file) != size) {
    perror(path);
    exit(1);
  }
  fclose(file);
  if (getenv("FUZZ_VERBOSE")) fprintf(stderr, "%s\n", path);
  LLVMFuzzerTestOneInput(data, size);
  free(data);
  return 1;
}

static int replay(const char *path)
{
  DIR *folder = opendir(path);
  if (!folder) return replay_file(path);
  int count = 0;
  for (const struct dirent *e; (e = readdir(folder));) {
    char name[4096];
    if (e->d_name[0] == '.') continue;
    snprintf(name, sizeof name, "%s/%s", path, e->d_name);
    count += replay_file(name);
  }
  closedir(folder);
  return count;
}

int main(int argc, char **argv)
{
  int count = 0;
  for (int i = 1; i < argc; i++) count += replay(argv[i]);
  printf("%d inputs\n", count);
  return count ? 0 : 1;
}
