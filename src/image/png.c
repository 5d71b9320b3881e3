#include "image/codec.h"
#include "base/io.h"
#include <errno.h>
#include <png.h>
#include <setjmp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Everything that lives across libpng's longjmp sits here, in memory, not in registers. */
typedef struct png_job {
  png_structp png;
  png_infop info;
  const unsigned char *bytes;
  size_t size, at;
  png_bytep *rows;
  png_byte *line;
  sf_image *image;
  const char *path;
  sf_status status;
  char message[200];
} png_job;

static void on_error(png_structp png, png_const_charp message)
{
  png_job *job = png_get_error_ptr(png);
  snprintf(job->message, sizeof job->message, "%s", message);
  png_longjmp(png, 1);
}

static void on_warning(png_structp png, png_const_charp message)
{
  (void)png, (void)message;
}

static void read_bytes(png_structp png, png_bytep out, size_t n)
{
  png_job *job = png_get_io_ptr(png);
  if (n > job->size - job->at) png_error(png, "the file is cut short");
  memcpy(out, job->bytes + job->at, n);
  job->at += n;
}

/* Every PNG becomes 16-bit RGBA in the machine's byte order; 8-bit values are widened by 257. */
static void ask_for_rgba16(png_structp png, png_infop info)
{
  const uint16_t one = 1;
  png_set_expand(png);
  png_set_expand_16(png);
  png_set_gray_to_rgb(png);
  png_set_add_alpha(png, 0xffff, PNG_FILLER_AFTER);
  if (*(const unsigned char *)&one) png_set_swap(png);
  png_set_interlace_handling(png);
  png_read_update_info(png, info);
}

static void decode(png_job *job)
{
  png_set_read_fn(job->png, job, read_bytes);
  png_set_user_limits(job->png, 1 << 28, 1 << 28);
  /* Texts, profiles and the like are skipped: libpng would believe any length that they state. */
  png_set_keep_unknown_chunks(job->png, PNG_HANDLE_CHUNK_NEVER, NULL, -1);
  png_read_info(job->png, job->info);
  uint32_t width = png_get_image_width(job->png, job->info), height = png_get_image_height(job->png, job->info);
  if (!sf_deflate_holds(job->size, (uint64_t)png_get_rowbytes(job->png, job->info) * height)) {
    job->status =
        sf_fail(SF_E_FORMAT, "%s: PNG: %zu bytes cannot hold %u x %u pixels", job->path, job->size, width, height);
    return;
  }
  ask_for_rgba16(job->png, job->info);
  if (png_get_rowbytes(job->png, job->info) != (size_t)width * 8) png_error(job->png, "unexpected row size");
  job->status = sf_image_alloc(job->image, job->path, width, height);
  if (job->status.code != SF_OK) return;
  job->rows = malloc(height * sizeof *job->rows);
  if (!job->rows) png_error(job->png, "no memory");
  for (uint32_t y = 0; y < height; y++) job->rows[y] = (png_bytep)(job->image->rgba + (size_t)y * width * 4);
  png_read_image(job->png, job->rows);
  png_read_end(job->png, NULL);
}

sf_status sf_png_load(sf_image *image, const char *path, const unsigned char *bytes, size_t size)
{
  png_job job = {.bytes = bytes, .size = size, .image = image, .path = path, .status = sf_ok()};
  job.png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &job, on_error, on_warning);
  job.info = job.png ? png_create_info_struct(job.png) : NULL;
  if (!job.info) {
    png_destroy_read_struct(&job.png, NULL, NULL);
    return sf_fail(SF_E_MEMORY, "%s: no memory", path);
  }
  if (setjmp(png_jmpbuf(job.png)))
    job.status = sf_fail(SF_E_FORMAT, "%s: PNG: %s", path, job.message);
  else
    decode(&job);
  png_destroy_read_struct(&job.png, &job.info, NULL);
  free(job.rows);
  if (job.status.code != SF_OK) sf_image_free(image);
  return job.status;
}

static void encode(png_job *job, FILE *file)
{
  const sf_image *image = job->image;
  png_init_io(job->png, file);
  png_set_IHDR(job->png, job->info, (png_uint_32)image->width, (png_uint_32)image->height, 8, PNG_COLOR_TYPE_RGB_ALPHA,
               PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  png_write_info(job->png, job->info);
  size_t n = (size_t)image->width * 4;
  job->line = malloc(n);
  if (!job->line) png_error(job->png, "no memory");
  for (int y = 0; y < image->height; y++) {
    const uint16_t *row = image->rgba + (size_t)y * n;
    for (size_t i = 0; i < n; i++) job->line[i] = (png_byte)((row[i] * 255u + 32767u) / 65535u);
    png_write_row(job->png, job->line);
  }
  png_write_end(job->png, NULL);
}

sf_status sf_image_save_png(const sf_image *image, const char *path)
{
  if (image->width < 1 || image->height < 1 || !image->rgba)
    return sf_fail(SF_E_RANGE, "%s: an image of %d x %d pixels cannot be saved", path, image->width, image->height);
  sf_image shown = *image;
  sf_writer writer;
  SF_TRY(sf_writer_open(&writer, path));
  png_job job = {.image = &shown, .path = path, .status = sf_ok()};
  job.png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &job, on_error, on_warning);
  job.info = job.png ? png_create_info_struct(job.png) : NULL;
  if (!job.info)
    job.status = sf_fail(SF_E_MEMORY, "%s: no memory", path);
  else if (setjmp(png_jmpbuf(job.png)))
    job.status = sf_fail(SF_E_IO, "cannot write %s: %s", path, ferror(writer.file) ? strerror(errno) : job.message);
  else
    encode(&job, writer.file);
  png_destroy_write_struct(&job.png, &job.info);
  free(job.line);
  if (job.status.code == SF_OK) return sf_writer_commit(&writer);
  sf_writer_abort(&writer);
  return job.status;
}
