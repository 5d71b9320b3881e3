#include "base/io.h"
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

/* A pipe may never end: what a program hands over in one is far smaller. */
static const size_t PIPE_LIMIT = (size_t)256 << 20;

static sf_status read_stream(FILE *file, const char *path, size_t expected, size_t limit, char **data, size_t *size)
{
  size_t room = expected + 1, used = 0;
  char *buffer = malloc(room + 1);
  if (!buffer) return sf_fail(SF_E_MEMORY, "%s: no memory for %zu bytes", path, room);
  for (;;) {
    size_t n = fread(buffer + used, 1, room - used, file);
    used += n;
    if (used > limit) {
      free(buffer);
      return sf_fail(SF_E_FORMAT, "%s: larger than the limit of %zu bytes", path, limit);
    }
    if (used < room) break;
    room = room > limit / 2 ? limit + 1 : 2 * room;
    char *grown = realloc(buffer, room + 1);
    if (!grown) {
      free(buffer);
      return sf_fail(SF_E_MEMORY, "%s: no memory for %zu bytes", path, room);
    }
    buffer = grown;
  }
  if (ferror(file)) {
    free(buffer);
    return sf_fail(SF_E_IO, "cannot read %s: %s", path, strerror(errno));
  }
  buffer[used] = 0;
  *data = buffer, *size = used;
  return sf_ok();
}

sf_status sf_read_file(const char *path, size_t limit, char **data, size_t *size)
{
  *data = NULL, *size = 0;
  FILE *file = fopen(path, "rbe");
  if (!file) return sf_fail(SF_E_IO, "cannot read %s: %s", path, strerror(errno));
  struct stat info;
  sf_status status;
  if (fstat(fileno(file), &info))
    status = sf_fail(SF_E_IO, "cannot read %s: %s", path, strerror(errno));
  else if (S_ISDIR(info.st_mode))
    status = sf_fail(SF_E_IO, "cannot read %s: it is a folder", path);
  else if (S_ISREG(info.st_mode) && (uintmax_t)info.st_size > limit)
    status = sf_fail(SF_E_FORMAT, "%s: %jd bytes, larger than the limit of %zu", path, (intmax_t)info.st_size, limit);
  else if (S_ISREG(info.st_mode))
    status = read_stream(file, path, (size_t)info.st_size, limit, data, size);
  else if (S_ISFIFO(info.st_mode) || S_ISSOCK(info.st_mode))
    status = read_stream(file, path, 4096, limit < PIPE_LIMIT ? limit : PIPE_LIMIT, data, size);
  else
    status = sf_fail(SF_E_IO, "cannot read %s: it is a device", path);
  fclose(file);
  return status;
}

/* Renaming onto a device or a folder would replace or miss it; through a link, the linked file is meant. */
static sf_status resolve_target(sf_writer *writer, const char *path)
{
  if (!*path) return sf_fail(SF_E_IO, "cannot write a file with an empty name");
  if (strlen(path) >= sizeof writer->path) return sf_fail(SF_E_IO, "cannot write %.80s...: name too long", path);
  strcpy(writer->path, path);
  struct stat info;
  if (lstat(path, &info)) return sf_ok();
  if (S_ISLNK(info.st_mode) && !stat(path, &info)) {
    char *target = realpath(path, NULL);
    bool fits = target && strlen(target) < sizeof writer->path;
    if (fits) strcpy(writer->path, target);
    free(target);
    if (!fits) return sf_fail(SF_E_IO, "cannot write %s: cannot follow the link", path);
  }
  if (S_ISDIR(info.st_mode)) return sf_fail(SF_E_IO, "cannot write %s: it is a folder", path);
  if (!S_ISREG(info.st_mode) && !S_ISLNK(info.st_mode))
    return sf_fail(SF_E_IO, "cannot write %s: it is not a regular file", path);
  return sf_ok();
}

/* The file aside has one name per target, so that the next save overwrites what a killed program left. The lock ends
 * with its program. -1: a program that lives is writing there, or the folder cannot hold such a file. */
static int open_fixed(sf_writer *writer, int folder)
{
  struct stat held, there;
  snprintf(writer->aside, sizeof writer->aside, "%.*s.%s.sf-new", folder, writer->path, writer->path + folder);
  const int fd = open(writer->aside, O_RDWR | O_CREAT | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC, 0666);
  if (fd < 0) return -1;
  if (!flock(fd, LOCK_EX | LOCK_NB) && !fstat(fd, &held) && S_ISREG(held.st_mode) && held.st_nlink == 1 &&
      !stat(writer->aside, &there) && there.st_dev == held.st_dev && there.st_ino == held.st_ino && !ftruncate(fd, 0))
    return fd;
  close(fd);
  return -1;
}

static int open_unique(sf_writer *writer, int folder)
{
  int fd = -1;
  for (unsigned i = 0; fd < 0 && i < 100000; i++) {
    snprintf(writer->aside, sizeof writer->aside, "%.*s.sf-%ld-%u", folder, writer->path, (long)getpid(), i);
    fd = open(writer->aside, O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (fd < 0 && errno != EEXIST) break;
  }
  return fd;
}

sf_status sf_writer_open(sf_writer *writer, const char *path)
{
  writer->file = NULL, writer->aside[0] = 0;
  SF_TRY(resolve_target(writer, path));
  const char *slash = strrchr(writer->path, '/');
  const int folder = slash ? (int)(slash - writer->path) + 1 : 0;
  int fd = open_fixed(writer, folder);
  if (fd < 0) fd = open_unique(writer, folder);
  writer->lock = fd < 0 ? -1 : fcntl(fd, F_DUPFD_CLOEXEC, 0);
  if (writer->lock >= 0) writer->file = fdopen(fd, "wb");
  if (writer->file) return sf_ok();
  sf_status status = sf_fail(SF_E_IO, "cannot write %s: %s", path, strerror(errno));
  if (fd >= 0) unlink(writer->aside), close(fd);
  if (writer->lock >= 0) close(writer->lock);
  writer->aside[0] = 0;
  return status;
}

/* Makes the rename itself durable; some file systems refuse to sync a folder, which loses nothing. */
static void sync_folder(const char *path)
{
  char folder[4096];
  snprintf(folder, sizeof folder, "%s", path);
  char *slash = strrchr(folder, '/');
  if (slash) slash[1] = 0;
  int fd = open(slash ? folder : ".", O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd < 0) return;
  (void)!fsync(fd);
  close(fd);
}

/* Why writing failed earlier: errno is of something else by now, but one more write fails for the same cause. */
static int refusal(int file)
{
  static const char nothing[65536];
  errno = 0;
  const ssize_t n = write(file, nothing, sizeof nothing);
  if (n >= 0 && n < (ssize_t)sizeof nothing) (void)!write(file, nothing, sizeof nothing); /* room for less than that */
  return errno ? errno : EIO;
}

sf_status sf_writer_commit(sf_writer *writer)
{
  if (!writer->file) return sf_fail(SF_E_IO, "cannot write %s: it is not open", writer->path);
  int error = 0;
  if (ferror(writer->file)) error = refusal(fileno(writer->file));
  if (fflush(writer->file) && !error) error = errno;
  if (!error && fsync(fileno(writer->file)) && errno != EINVAL && errno != EROFS) error = errno;
  if (fclose(writer->file) && !error) error = errno;
  writer->file = NULL;
  /* Still locked: nobody else may begin to write what is renamed here. */
  if (!error && rename(writer->aside, writer->path)) error = errno;
  if (error) {
    sf_writer_abort(writer);
    return sf_fail(SF_E_IO, "cannot write %s: %s", writer->path, strerror(error));
  }
  writer->aside[0] = 0;
  close(writer->lock);
  sync_folder(writer->path);
  return sf_ok();
}

void sf_writer_abort(sf_writer *writer)
{
  if (writer->aside[0]) {
    unlink(writer->aside);
    close(writer->lock);
  }
  if (writer->file) fclose(writer->file);
  writer->file = NULL, writer->aside[0] = 0;
}

/* A signal waits until the file aside is gone. */
sf_status sf_writable(const char *path)
{
  sf_writer writer;
  sigset_t all, before;
  sigfillset(&all);
  pthread_sigmask(SIG_BLOCK, &all, &before);
  const sf_status status = sf_writer_open(&writer, path);
  if (!status.code) sf_writer_abort(&writer);
  pthread_sigmask(SIG_SETMASK, &before, NULL);
  return status;
}

sf_status sf_readable(const char *path)
{
  FILE *file = fopen(path, "rb");
  if (!file) return sf_fail(SF_E_IO, "cannot read %s: %s", path, strerror(errno));
  fclose(file);
  return sf_ok();
}

sf_status sf_write_file(const char *path, const void *data, size_t size)
{
  sf_writer writer;
  SF_TRY(sf_writer_open(&writer, path));
  if (size && fwrite(data, 1, size, writer.file) != size) {
    int error = errno;
    sf_writer_abort(&writer);
    return sf_fail(SF_E_IO, "cannot write %s: %s", path, strerror(error));
  }
  return sf_writer_commit(&writer);
}

static sf_status make_one_dir(const char *path)
{
  struct stat info;
  if (!mkdir(path, 0777)) return sf_ok();
  int error = errno;
  if (!stat(path, &info)) {
    if (S_ISDIR(info.st_mode)) return sf_ok();
    error = ENOTDIR;
  }
  return sf_fail(SF_E_IO, "cannot make the folder %s: %s", path, strerror(error));
}

sf_status sf_make_dir(const char *path)
{
  char part[4096];
  size_t n = strlen(path);
  if (!n) return sf_fail(SF_E_IO, "cannot make a folder with an empty name");
  if (n >= sizeof part) return sf_fail(SF_E_IO, "cannot make the folder %.80s...: name too long", path);
  for (size_t i = 1; i < n; i++) {
    if (path[i] != '/' || path[i - 1] == '/') continue;
    memcpy(part, path, i);
    part[i] = 0;
    SF_TRY(make_one_dir(part));
  }
  return make_one_dir(path);
}
