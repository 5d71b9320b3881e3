/* EXR through the OpenEXR Core C API; all file access goes through this library's own reader and writer. */
#include "image/codec.h"
#include "base/io.h"
#include <openexr.h>
#include <errno.h>
#include <limits.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define MAX_PIXELS ((int64_t)1 << 28)
#define FILE_LIMIT ((size_t)1 << 33)

/* The library's view of one open file. */
typedef struct exr_stream {
  const char *bytes; /* reading */
  size_t size;
  int fd; /* writing */
  char message[200];
} exr_stream;

static void on_read_error(exr_const_context_t context, exr_result_t code, const char *message)
{
  void *user = NULL;
  (void)code;
  if (!context || exr_get_user_data(context, &user) != EXR_ERR_SUCCESS || !user) return;
  exr_stream *stream = user;
  if (!stream->message[0]) snprintf(stream->message, sizeof stream->message, "%s", message);
}

/* A writing context holds its lock while it reports, and asking it for the user data would wait for that lock. */
static void on_write_error(exr_const_context_t context, exr_result_t code, const char *message)
{
  (void)context, (void)code, (void)message;
}

static int64_t stream_size(exr_const_context_t context, void *user)
{
  (void)context;
  return (int64_t)((exr_stream *)user)->size;
}

static int64_t stream_read(exr_const_context_t context, void *user, void *buffer, uint64_t n, uint64_t offset,
                           exr_stream_error_func_ptr_t error)
{
  const exr_stream *stream = user;
  (void)context, (void)error;
  if (offset >= stream->size) return 0;
  if (n > stream->size - offset) n = stream->size - offset;
  memcpy(buffer, stream->bytes + offset, n);
  return (int64_t)n;
}

static int64_t stream_write(exr_const_context_t context, void *user, const void *buffer, uint64_t n, uint64_t offset,
                            exr_stream_error_func_ptr_t error)
{
  exr_stream *stream = user;
  const char *bytes = buffer;
  (void)context, (void)error;
  for (uint64_t done = 0; done < n;) {
    ssize_t w = pwrite(stream->fd, bytes + done, n - done, (off_t)(offset + done));
    if (w < 0 && errno == EINTR) continue;
    if (w <= 0) {
      snprintf(stream->message, sizeof stream->message, "%s", strerror(w ? errno : ENOSPC));
      return -1;
    }
    done += (uint64_t)w;
  }
  return (int64_t)n;
}

static exr_context_initializer_t stream_setup(exr_stream *stream, exr_error_handler_cb_t on_error)
{
  exr_context_initializer_t setup = EXR_DEFAULT_CONTEXT_INITIALIZER;
  setup.error_handler_fn = on_error;
  setup.user_data = stream;
  setup.read_fn = stream_read;
  setup.size_fn = stream_size;
  setup.write_fn = stream_write;
  setup.flags = EXR_CONTEXT_FLAG_DISABLE_CHUNK_RECONSTRUCTION;
  return setup;
}

static const char *describe(const exr_stream *stream, exr_result_t result)
{
  return stream->message[0] ? stream->message : exr_get_default_error_message(result);
}

static exr_pixel_type_t pixel_type(sf_exr_type type)
{
  return type == SF_EXR_HALF ? EXR_PIXEL_HALF : type == SF_EXR_FLOAT ? EXR_PIXEL_FLOAT : EXR_PIXEL_UINT;
}

/* ---- writing ---- */

static int by_name(const void *a, const void *b)
{
  return strcmp(((const sf_exr_channel *)a)->name, ((const sf_exr_channel *)b)->name);
}

static exr_result_t write_header(exr_context_t context, int width, int height, const sf_exr_channel *channels, int n,
                                 const char *const *attributes)
{
  int part;
  exr_result_t r = exr_add_part(context, NULL, EXR_STORAGE_SCANLINE, &part);
  if (!r) r = exr_initialize_required_attr_simple(context, part, width, height, EXR_COMPRESSION_ZIP);
  for (int i = 0; i < n && !r; i++)
    r = exr_add_channel(context, part, channels[i].name, pixel_type(channels[i].type), EXR_PERCEPTUALLY_LOGARITHMIC, 1,
                        1);
  for (int i = 0; attributes && attributes[i] && !r; i += 2)
    r = exr_attr_set_string(context, part, attributes[i], attributes[i + 1] ? attributes[i + 1] : "");
  return r ? r : exr_write_header(context);
}

static void point_channel(exr_coding_channel_info_t *info, const sf_exr_channel *channel, int width, int64_t row)
{
  info->user_bytes_per_element = 4;
  info->user_data_type = channel->type == SF_EXR_UINT ? EXR_PIXEL_UINT : EXR_PIXEL_FLOAT;
  info->user_pixel_stride = 4;
  info->user_line_stride = 4 * width;
  info->decode_to_ptr = (uint8_t *)channel->data + (size_t)row * (size_t)width * 4;
}

static exr_result_t write_rows(exr_context_t context, int width, int height, const sf_exr_channel *channels)
{
  exr_encode_pipeline_t pipeline = EXR_ENCODE_PIPELINE_INITIALIZER;
  int32_t lines = 1;
  bool ready = false;
  exr_result_t r = exr_get_scanlines_per_chunk(context, 0, &lines);
  for (int y = 0; y < height && !r; y += lines) {
    exr_chunk_info_t chunk;
    if ((r = exr_write_scanline_chunk_info(context, 0, y, &chunk))) break;
    r = ready ? exr_encoding_update(context, 0, &chunk, &pipeline)
              : exr_encoding_initialize(context, 0, &chunk, &pipeline);
    if (r) break;
    for (int i = 0; i < pipeline.channel_count; i++) point_channel(&pipeline.channels[i], &channels[i], width, y);
    if (!ready) r = exr_encoding_choose_default_routines(context, 0, &pipeline);
    ready = true;
    if (!r) r = exr_encoding_run(context, 0, &pipeline);
  }
  exr_encoding_destroy(context, &pipeline);
  return r;
}

static sf_status check_channels(const char *path, int width, int height, const sf_exr_channel *sorted, int n)
{
  if (width < 1 || height < 1 || (int64_t)width * height > MAX_PIXELS || width > INT32_MAX / 8 || n < 1)
    return sf_fail(SF_E_RANGE, "%s: an EXR image of %d x %d pixels and %d channels", path, width, height, n);
  for (int i = 0; i < n; i++) {
    size_t length = strnlen(sorted[i].name, sizeof sorted[i].name);
    if (!length || length == sizeof sorted[i].name || !sorted[i].data)
      return sf_fail(SF_E_RANGE, "%s: EXR channel '%.31s' has no data or no proper name", path, sorted[i].name);
    if (i && !strcmp(sorted[i - 1].name, sorted[i].name))
      return sf_fail(SF_E_RANGE, "%s: two EXR channels are named '%s'", path, sorted[i].name);
  }
  return sf_ok();
}

static sf_status write_stream(const char *path, int width, int height, const sf_exr_channel *sorted, int n,
                              const char *const *attributes)
{
  sf_writer writer;
  SF_TRY(sf_writer_open(&writer, path));
  exr_stream stream = {.fd = fileno(writer.file)};
  exr_context_initializer_t setup = stream_setup(&stream, on_write_error);
  exr_context_t context = NULL;
  exr_result_t r = exr_start_write(&context, path, EXR_WRITE_FILE_DIRECTLY, &setup);
  if (!r) r = write_header(context, width, height, sorted, n, attributes);
  if (!r) r = write_rows(context, width, height, sorted);
  exr_result_t closed = context ? exr_finish(&context) : EXR_ERR_SUCCESS;
  if (!r) r = closed;
  if (!r) return sf_writer_commit(&writer);
  sf_writer_abort(&writer);
  return sf_fail(r == EXR_ERR_OUT_OF_MEMORY ? SF_E_MEMORY : SF_E_IO, "cannot write %s: EXR: %s", path,
                 describe(&stream, r));
}

sf_status sf_exr_save(const char *path, int width, int height, const sf_exr_channel *channels, int n,
                      const char *const *attributes)
{
  sf_exr_channel *sorted = malloc((size_t)(n > 0 ? n : 1) * sizeof *sorted);
  if (!sorted) return sf_fail(SF_E_MEMORY, "%s: no memory", path);
  if (n > 0) {
    memcpy(sorted, channels, (size_t)n * sizeof *sorted);
    qsort(sorted, (size_t)n, sizeof *sorted, by_name); /* the order that the format requires */
  }
  sf_status status = check_channels(path, width, height, sorted, n);
  if (status.code == SF_OK) status = write_stream(path, width, height, sorted, n, attributes);
  free(sorted);
  return status;
}

/* ---- reading ---- */

void sf_exr_free(sf_exr_channel *channels, int n)
{
  for (int i = 0; channels && i < n; i++) free(channels[i].data);
  free(channels);
}

/* Bytes of a pixel on file; 0 without channels. */
static uint64_t pixel_bytes(exr_const_context_t context)
{
  const exr_attr_chlist_t *list;
  uint64_t bytes = 0;
  if (exr_get_channels(context, 0, &list)) return 0;
  for (int i = 0; i < list->num_channels; i++) bytes += list->entries[i].pixel_type == EXR_PIXEL_HALF ? 2 : 4;
  return bytes;
}

static sf_status check_layout(exr_context_t context, const char *path, size_t size, int *width, int *height)
{
  int parts = 0;
  exr_storage_t storage;
  exr_attr_box2i_t box;
  if (exr_get_count(context, &parts) || parts != 1)
    return sf_fail(SF_E_UNSUPPORTED, "%s: EXR: %d parts, only single-part files are read", path, parts);
  if (exr_get_storage(context, 0, &storage) || storage != EXR_STORAGE_SCANLINE)
    return sf_fail(SF_E_UNSUPPORTED, "%s: EXR: tiled or deep, only scanline files are read", path);
  if (exr_get_data_window(context, 0, &box)) return sf_fail(SF_E_FORMAT, "%s: EXR: no data window", path);
  int64_t w = (int64_t)box.max.x - box.min.x + 1, h = (int64_t)box.max.y - box.min.y + 1;
  if (w < 1 || h < 1 || w > INT32_MAX / 8 || h > INT32_MAX || w * h > MAX_PIXELS)
    return sf_fail(SF_E_RANGE, "%s: EXR: an image of %jd x %jd pixels", path, (intmax_t)w, (intmax_t)h);
  exr_compression_t packing;
  if (exr_get_compression(context, 0, &packing) || packing > EXR_COMPRESSION_ZIP)
    return sf_fail(SF_E_UNSUPPORTED, "%s: EXR: only files without compression, with RLE and with ZIP are read", path);
  const uint64_t bytes = pixel_bytes(context); /* a channel takes bytes of the header: the product fits 64 bits */
  if (!sf_deflate_holds(size, (uint64_t)(w * h) * bytes))
    return sf_fail(SF_E_FORMAT, "%s: EXR: %zu bytes cannot hold %jd x %jd pixels of %ju bytes", path, size, (intmax_t)w,
                   (intmax_t)h, (uintmax_t)bytes);
  *width = (int)w, *height = (int)h;
  return sf_ok();
}

static sf_status make_channels(exr_context_t context, const char *path, int width, int height,
                               sf_exr_channel **channels, int *n)
{
  const exr_attr_chlist_t *list;
  if (exr_get_channels(context, 0, &list) || list->num_channels < 1)
    return sf_fail(SF_E_FORMAT, "%s: EXR: no channels", path);
  *channels = calloc((size_t)list->num_channels, sizeof **channels);
  if (!*channels) return sf_fail(SF_E_MEMORY, "%s: no memory", path);
  for (*n = 0; *n < list->num_channels; ++*n) {
    const exr_attr_chlist_entry_t *entry = &list->entries[*n];
    sf_exr_channel *channel = &(*channels)[*n];
    if (entry->name.length >= (int)sizeof channel->name || entry->x_sampling != 1 || entry->y_sampling != 1)
      return sf_fail(SF_E_UNSUPPORTED, "%s: EXR: channel '%.40s': subsampled or its name is over 31 bytes", path,
                     entry->name.str);
    strcpy(channel->name, entry->name.str);
    channel->type = entry->pixel_type == EXR_PIXEL_HALF    ? SF_EXR_HALF
                    : entry->pixel_type == EXR_PIXEL_FLOAT ? SF_EXR_FLOAT
                                                           : SF_EXR_UINT;
    channel->data = calloc((size_t)width * (size_t)height, 4);
    if (!channel->data) return sf_fail(SF_E_MEMORY, "%s: no memory for channel '%s'", path, channel->name);
  }
  return sf_ok();
}

static exr_result_t read_rows(exr_context_t context, int width, int height, const sf_exr_channel *channels, int n)
{
  exr_decode_pipeline_t pipeline = EXR_DECODE_PIPELINE_INITIALIZER;
  exr_attr_box2i_t box;
  int32_t lines = 1;
  bool ready = false;
  exr_result_t r = exr_get_data_window(context, 0, &box);
  if (!r) r = exr_get_scanlines_per_chunk(context, 0, &lines);
  for (int64_t y = 0; y < height && !r; y += lines) {
    exr_chunk_info_t chunk;
    if ((r = exr_read_scanline_chunk_info(context, 0, (int)(box.min.y + y), &chunk))) break;
    if (chunk.width != width || chunk.height < 1 || chunk.height > height - y) r = EXR_ERR_BAD_CHUNK_LEADER;
    if (!r && ready) r = exr_decoding_update(context, 0, &chunk, &pipeline);
    if (!r && !ready) r = exr_decoding_initialize(context, 0, &chunk, &pipeline);
    if (!r && pipeline.channel_count != n) r = EXR_ERR_BAD_CHUNK_LEADER;
    if (r) break;
    for (int i = 0; i < n; i++) point_channel(&pipeline.channels[i], &channels[i], width, y);
    if (!ready) r = exr_decoding_choose_default_routines(context, 0, &pipeline);
    ready = true;
    if (!r) r = exr_decoding_run(context, 0, &pipeline);
  }
  exr_decoding_destroy(context, &pipeline);
  return r;
}

static sf_status read_stream(const char *path, exr_stream *stream, int *width, int *height, sf_exr_channel **channels,
                             int *n)
{
  exr_context_initializer_t setup = stream_setup(stream, on_read_error);
  exr_context_t context = NULL;
  exr_result_t r = exr_start_read(&context, path, &setup);
  if (r) {
    if (context) exr_finish(&context);
    return sf_fail(SF_E_FORMAT, "%s: EXR: %s", path, describe(stream, r));
  }
  sf_status status = check_layout(context, path, stream->size, width, height);
  if (status.code == SF_OK) status = make_channels(context, path, *width, *height, channels, n);
  if (status.code == SF_OK && (r = read_rows(context, *width, *height, *channels, *n)))
    status = sf_fail(SF_E_FORMAT, "%s: EXR: %s", path, describe(stream, r));
  exr_finish(&context);
  return status;
}

sf_status sf_exr_load(const char *path, int *width, int *height, sf_exr_channel **channels, int *n)
{
  char *bytes;
  exr_stream stream = {.fd = -1};
  *channels = NULL, *n = 0;
  SF_TRY(sf_read_file(path, FILE_LIMIT, &bytes, &stream.size));
  stream.bytes = bytes;
  sf_status status = read_stream(path, &stream, width, height, channels, n);
  free(bytes);
  if (status.code != SF_OK) {
    sf_exr_free(*channels, *n);
    *channels = NULL, *n = 0;
  }
  return status;
}
