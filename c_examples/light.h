/* Light on a grey surface with two sides: a lamp, the sky and the ground. */
#ifndef LIGHT_H
#define LIGHT_H

#include "camera.h"
#include "vector.h"

#include <hgrid.h>

typedef struct {
    vector up, toward_lamp;
    /* The factor of sky and ground, 1 for a picture without occlusion. */
    double sky_gain;
} lights;

/* Places the lamp behind the viewer's left shoulder, infinitely far away. */
lights lights_of(const camera *c, double sky_gain);

/* Returns the most that the lamp can add at a normal: 0 on the far side. */
double lamp_on(const lights *l, vector normal);

/* Colours a pixel of a surface. `lit` is the part of the lamp that reaches it, `open` that of the sky and the
 * ground, both 0 to 1. */
void paint_surface(const lights *l, vector normal, double lit, double open, unsigned char pixel[3]);

void paint_background(const lights *l, const hgrid_ray *ray, unsigned char pixel[3]);

/* Returns direction `i` of `count` into the hemisphere around a normal, with a cosine distribution: more of
 * them where more light comes from. Each pixel has its own pattern, the same every time. */
vector scatter(vector normal, uint32_t pixel, int i, int count);

#endif
