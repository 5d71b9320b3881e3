/* Analytic shapes and fogs of the procedural scenes. World units; z is up; double precision throughout. */
#ifndef SF_SCENE_STAGE_H
#define SF_SCENE_STAGE_H
#include <stdbool.h>
#include <stdint.h>

typedef struct sf_stage_ray {
  double origin[3], direction[3]; /* unit direction */
} sf_stage_ray;

typedef enum {
  SF_SPHERE,   /* size: radius */
  SF_BOX,      /* size: half sides */
  SF_CYLINDER, /* size: radius, half height; capped, axis along local z */
  SF_TORUS     /* size: ring radius, tube radius; axis along local z */
} sf_shape_kind;

typedef enum {
  SF_PLAIN,   /* colour[0] */
  SF_CHECKER, /* colour[0], colour[1] on the faces that look along local +z, elsewhere colour[2]; period = tile side */
  SF_STRIPES, /* colour[0], colour[1] along local x; period = width of one stripe */
  SF_SECTORS, /* six sectors around local z: colour[0..2], each followed by white; white caps */
  SF_SKY,     /* colour[0] to colour[1] in waves around z, paler upwards: unlit, and without a shadow */
  SF_TERRAZZO /* chips of colour[0..2], no two alike, in three sizes, all through the body; period = side of the largest
               */
} sf_pattern;

typedef struct sf_material {
  sf_pattern pattern;
  double period;
  double colour[3][3]; /* linear light, 0..1 */
  double shine;        /* strength of the Blinn-Phong highlight */
  int sharpness;       /* log2 of its exponent */
} sf_material;

typedef struct sf_shape {
  sf_shape_kind kind;
  double centre[3], size[3];
  double axes[9]; /* rows: the local axes in world coordinates */
  double bound;   /* radius of the bounding sphere */
  const sf_material *material;
} sf_shape;

/* Homogeneous fog in a sphere or a box: density per world unit, constant emitted colour. */
typedef struct sf_fog {
  sf_shape region;
  double density, colour[3];
} sf_fog;

enum { SF_STAGE_SHAPES = 64, SF_STAGE_FOGS = 4 };

/* What a procedural scene is made of; shapes and fogs count what is used. */
typedef struct sf_stage {
  sf_shape shape[SF_STAGE_SHAPES];
  sf_fog fog[SF_STAGE_FOGS];
  int shapes, fogs;
} sf_stage;

typedef struct sf_hit {
  double t, normal[3]; /* world, outward unit */
  double local[3];     /* hit point in the shape's own axes */
} sf_hit;

/* yaw turns around z, then tilt around the turned x axis; radians. */
void sf_shape_place(sf_shape *shape, sf_shape_kind kind, const double centre[3], const double size[3], double yaw,
                    double tilt);
/* Nearest hit with t in (near, hit->t); true when found, and then *hit is replaced. */
bool sf_shape_hit(const sf_shape *shape, const sf_stage_ray *ray, double near, sf_hit *hit);
/* Whether a cone around the ray (spread = half width per unit of distance) can touch the shape. */
bool sf_shape_near(const sf_shape *shape, const sf_stage_ray *ray, double spread);
/* Entry and exit along the ray; spheres and boxes only. */
bool sf_shape_interval(const sf_shape *shape, const sf_stage_ray *ray, double *enter, double *leave);

/* Builds scene `index` of sf_procedural_names. */
void sf_stage_build(sf_stage *stage, int index);
/* Premultiplied display colour and alpha of one ray; `candidates`: bit i set = shape i may be hit. */
void sf_stage_trace(const sf_stage *stage, const sf_stage_ray *ray, uint64_t candidates, double rgba[4]);

#endif
