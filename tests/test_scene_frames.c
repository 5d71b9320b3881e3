/* What is taken from transforms_*.json, and the words with which one is refused: kept as texts. */
#include "ck_run.h"
#include "tests/reader_fixture.h"

/* ---- JSON ---- */

static const char square[] = "\"transform_matrix\":[[1,0,0,5],[0,1,0,6],[0,0,1,7],[0,0,0,1]]";

/* Of a frame: its members with a whole matrix, or without. */
static void say_json(FILE *out, const char *members, bool matrix)
{
  char text[3000];
  const sf_lens shared = {.fl_x = 9, .fl_y = 8, .cx = 1, .has_cx = true, .angle_x = 0.5, .angle_y = 0.4, .camera = -1};
  sf_frame frame;
  memset(&frame, 0, sizeof frame);
  snprintf(text, sizeof text, "{%s%s%s}", members, matrix ? "," : "", matrix ? square : "");
  fprintf(out, "%.100s\n", members);
  cJSON *json = cJSON_Parse(text);
  ck_assert_msg(json != NULL, "%s", text);
  const sf_status status = sf_frame_parse(&frame, json, &shared, "file", 3);
  say_status(out, status);
  if (!status.code) say_frame(out, &frame);
  cJSON_Delete(json);
}

static const char *const frame_keys[] = {"",
                                         "\"fl_x\":1e7",
                                         "\"fl_x\":9999999,\"fl_y\":3",
                                         "\"fl_x\":0",
                                         "\"fl_x\":-1",
                                         "\"fl_x\":\"1\"",
                                         "\"fl_x\":1e999",
                                         "\"fl_y\":4",
                                         "\"fl_y\":1e7",
                                         "\"camera_angle_x\":0.7",
                                         "\"camera_angle_x\":3.2",
                                         "\"camera_angle_y\":0.6",
                                         "\"camera_angle_y\":3.15",
                                         "\"w\":40",
                                         "\"h\":30",
                                         "\"w\":40,\"h\":30",
                                         "\"w\":1e7",
                                         "\"h\":0",
                                         "\"cx\":-3,\"cy\":2",
                                         "\"cx\":1e7",
                                         "\"cx\":-1e7",
                                         "\"cy\":1e7",
                                         "\"cy\":-1e7",
                                         "\"k1\":0.1,\"k2\":0.2,\"p1\":0.3,\"p2\":0.4,\"k3\":0,\"k6\":0",
                                         "\"k1\":1e6",
                                         "\"k2\":-1e6",
                                         "\"p1\":1e6",
                                         "\"p2\":-1e6",
                                         "\"k1\":-999999",
                                         "\"k3\":0.1",
                                         "\"k4\":0.1",
                                         "\"k5\":-0.1",
                                         "\"k6\":1",
                                         "\"k3\":[]",
                                         "\"is_fisheye\":true",
                                         "\"is_fisheye\":false",
                                         "\"camera_model\":\"OPENCV\"",
                                         "\"camera_model\":\"PINHOLE\"",
                                         "\"camera_model\":\"SIMPLE_RADIAL\"",
                                         "\"camera_model\":\"OPENCV_FISHEYE\"",
                                         "\"camera_model\":7",
                                         "\"fl_x\":2,\"camera_angle_y\":0.3"};

static const char *const frame_matrices[] = {"[[2,0,0,5],[0,3,0,6],[0,0,4,7],[0,0,0,1]]",
                                             "[[0,1,0,5],[1,0,0,6],[0,0,1,7],[0,0,0,1]]",
                                             "[[1,0,0,5],[0,1,0,6],[0,0,1,7]]",
                                             "[[1,0,0,5],[0,1,0,6],[0,0,1,7],[0,0,0,1],[0,0,0,1]]",
                                             "[[1,0,0,5],[0,1,0,6,0],[0,0,1,7],[0,0,0,1]]",
                                             "[[1,0,0,5],[0,1,0],[0,0,1,7],[0,0,0,1]]",
                                             "[[1,0,0,5],1,[0,0,1,7],[0,0,0,1]]",
                                             "[[1,0,0,5],[0,1,\"0\",6],[0,0,1,7],[0,0,0,1]]",
                                             "[[1,0,0,5],[0,1,0,1e39],[0,0,1,7],[0,0,0,1]]",
                                             "[[1,0,0,5],[0,1,0,6],[0,0,1,7],[0,0,0,1.00002]]",
                                             "[[1,0,0,5],[0,1,0,6],[0,0,1,7],[0,0,0,1.000009]]",
                                             "[[1,0,0,5],[0,1,0,6],[0,0,1,7],[0,2e-5,0,1]]",
                                             "[[1,0,0,5],[0,1,0,6],[0,0,1,7],[0,0,-9e-6,1]]",
                                             "[[1,0,0,5],[0,0,0,6],[0,0,1,7],[0,0,0,1]]",
                                             "[[1,0,0,5],[0,1e-13,0,6],[0,0,1,7],[0,0,0,1]]",
                                             "[[1,0,0,5],[0,1e-11,0,6],[0,0,1,7],[0,0,0,1]]",
                                             "[[1,1,0,5],[0.009,0,0,6],[0,0,1,7],[0,0,0,1]]",
                                             "[[1,1,0,5],[0.011,0,0,6],[0,0,1,7],[0,0,0,1]]",
                                             "[[1,0,0.01,5],[0,1,0.01,6],[-0.01,-0.01,1,7],[0,0,0,1]]",
                                             "[[0.72,0.24,-0.8,5],[-1.6,0.3,0,6],[0.96,0.32,0.6,7],[0,0,0,1]]",
                                             "7"};

static void frames(FILE *out)
{
  char text[1000], name[300];
  for (int i = 0; i < COUNT(frame_keys); i++) {
    snprintf(text, sizeof text, "\"file_path\":\"./a/b\"%s%s", *frame_keys[i] ? "," : "", frame_keys[i]);
    say_json(out, text, true);
  }
  for (int n = 254; n < 258; n++) {
    snprintf(name, sizeof name, "%0*d", n, 7);
    snprintf(text, sizeof text, "\"file_path\":\"%s\"", name);
    say_json(out, text, true);
  }
  say_json(out, "\"file_path\":\"./\"", true), say_json(out, "\"file_path\":\"\"", true);
  say_json(out, "\"file_path\":\".x\"", true), say_json(out, "\"file_path\":1", true);
  for (int i = 0; i < COUNT(frame_matrices); i++) {
    snprintf(text, sizeof text, "\"transform_matrix\":%s,\"file_path\":\"m\"", frame_matrices[i]);
    say_json(out, text, false);
  }
  say_json(out, "\"file_path\":\"m\"", false);
  sf_lens none = {0};
  sf_frame frame = {0};
  cJSON *json = cJSON_Parse("{\"file_path\":\"m\"}"), *list = cJSON_CreateArray();
  say_status(out, sf_frame_parse(&frame, json, &none, "file", 0));
  say_status(out, sf_frame_parse(&frame, list, &none, "file", 0));
  cJSON_Delete(json), cJSON_Delete(list);
}

TEST(frames_of_json)
{
  ck_expected_text("frames.txt", out, frames(out));
}

/* Files of a folder, and what is read of the split. */
static void say_transforms(FILE *out, const char *train, const char *test, const char *both, const char *split)
{
  const char *const text[] = {train, test, both};
  static const char *const name[] = {"transforms_train.json", "transforms_test.json", "transforms.json"};
  sf_capture c = {0};
  remove_folder(), make_folder();
  fprintf(out, "%s of %.90s | %.90s | %.90s\n", split, train ? train : "-", test ? test : "-", both ? both : "-");
  for (int i = 0; i < 3; i++)
    if (text[i]) put_file(in(name[i]), text[i], strlen(text[i]));
  if (split[0] == 'v' && train) put_file(in("transforms_val.json"), train, strlen(train));
  put_file(in("p.png"), "PIC", 3);
  fprintf(out, "  there %d\n", sf_transforms_there(folder));
  const sf_status status = sf_transforms_read(&c, folder, split);
  say_status(out, status);
  if (!status.code) {
    fprintf(out, "  %s layout %d part %d count %d listed %d first %d poses %d picture %d\n",
            c.list + strlen(folder) + 1, c.layout, c.part, c.count, c.listed, c.first, c.poses, c.picture);
    fprintf(out, "  placed %d scale %g offset %g %g %g aabb %d\n", c.placed, c.box_scale, c.box_offset[0],
            c.box_offset[1], c.box_offset[2], c.aabb_scale);
    for (int f = 0; f < c.count; f++) say_frame(out, &c.frame[f]);
  }
  free(c.frame);
}

static void transforms(FILE *out)
{
  static const char *const heads[] = {"",
                                      "\"aabb_scale\":1,",
                                      "\"aabb_scale\":128,\"scale\":0.5,",
                                      "\"aabb_scale\":129,",
                                      "\"aabb_scale\":3,",
                                      "\"aabb_scale\":1.5,",
                                      "\"aabb_scale\":0,",
                                      "\"scale\":2,",
                                      "\"scale\":0,",
                                      "\"scale\":1e9,",
                                      "\"offset\":[0.1,0.2,0.3],",
                                      "\"offset\":[0.1,0.2],",
                                      "\"offset\":[0.1,0.2,1e9],",
                                      "\"offset\":[0.1,\"0\",0],",
                                      "\"offset\":4,",
                                      "\"fl_x\":-1,"};
  char list[3][700];
  for (int i = 0; i < COUNT(heads); i++) {
    snprintf(list[0], sizeof list[0],
             "{%s\"camera_angle_x\":0.7,\"frames\":[{\"file_path\":\"p.png\",%s},{\"file_path\":\"q\",%s}]}", heads[i],
             square, square);
    say_transforms(out, list[0], NULL, NULL, "train");
  }
  snprintf(list[1], sizeof list[1], "{\"camera_angle_x\":0.6,\"w\":40,\"frames\":[{\"file_path\":\"t\",%s}]}", square);
  snprintf(
      list[2], sizeof list[2],
      "{\"aabb_scale\":2,\"camera_angle_x\":0.5,\"frames\":[{\"file_path\":\"./p.png\",%s},{\"file_path\":\"b\",%s}]}",
      square, square);
  for (int there = 0; there < 8; there++)
    for (int s = 0; s < 3; s++) {
      static const char *const split[] = {"train", "test", "val"};
      say_transforms(out, there & 1 ? list[0] : NULL, there & 2 ? list[1] : NULL, there & 4 ? list[2] : NULL, split[s]);
    }
  snprintf(list[0], sizeof list[0], "{\"aabb_scale\":2,\"camera_angle_x\":0.5,\"frames\":[{\"file_path\":\"p\",%s}]}",
           square);
  say_transforms(out, list[0], list[1], NULL, "test");
  say_transforms(out, "{\"frames\":[]}", NULL, NULL, "train"), say_transforms(out, "{}", NULL, NULL, "train");
  say_transforms(out, "[]", NULL, NULL, "train"), say_transforms(out, "{\"frames\":[7]}", NULL, NULL, "train");
  say_transforms(out, "{\"frames\":[7]}", list[1], NULL, "test"), say_transforms(out, "[]", list[1], NULL, "test");
}

TEST(lists_of_views)
{
  ck_expected_text("transforms.txt", out, transforms(out));
}

ck_options ck_program = {.set_up = make_folder, .tear_down = remove_folder};
