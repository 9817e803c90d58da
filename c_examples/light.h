/* Light on a grey surface with two sides: a lamp, the sky and the ground. */
#ifndef LIGHT_H
#define LIGHT_H

#include "camera.h"
#include "vector.h"

#include <hgrid.h>

typedef struct {
    vector up, toward_lamp;
    /* How much brighter sky and ground are than in a picture without occlusion. */
    double sky_gain;
} lights;

/* The lamp stands behind the viewer's left shoulder, infinitely far away. */
lights lights_of(const camera *c, double sky_gain);

/* How much the lamp can add at a normal: 0 on the far side. */
double lamp_on(const lights *l, vector normal);

/* The colour of a surface. `lit` says how much of the lamp reaches it, `open` how much of the sky
 * and the ground, both 0 to 1. */
void paint_surface(const lights *l, vector normal, double lit, double open, unsigned char pixel[3]);

void paint_background(const lights *l, const hgrid_ray *ray, unsigned char pixel[3]);

/* Direction `i` of `count` into the hemisphere around a normal, more of them where more light comes
 * from: towards the normal, by the cosine. Each pixel has a pattern of its own, always the same. */
vector scatter(vector normal, uint32_t pixel, int i, int count);

#endif
