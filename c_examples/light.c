#include "light.h"

/* The light of the lamp, the sky and the ground; the background at the picture's upper and lower edge. All
 * are linear red, green, blue. */
static const double LAMP[3] = {0.62, 0.60, 0.56};
static const double SKY[3] = {0.09, 0.11, 0.14}, GROUND[3] = {0.03, 0.027, 0.024};
static const double ZENITH[3] = {0.008, 0.018, 0.055}, HORIZON[3] = {0.22, 0.31, 0.44};

lights lights_of(const camera *c, double sky_gain)
{
    const vector up = vector_of(c->up), toward_eye = scale(vector_of(c->forward), -1);
    const vector from_left = offset(scale(vector_of(c->right), -0.7), 0.8, up);
    const lights l = {up, unit(offset(from_left, 1, toward_eye), toward_eye), sky_gain};
    return l;
}

double lamp_on(const lights *l, vector normal)
{
    return larger(dot(normal, l->toward_lamp), 0);
}

static double clamp(double x)
{
    return x < 0 ? 0 : x > 1 ? 1 : x;
}

/* Converts linear light to a screen's value; a square root is close to a screen's curve. */
static unsigned char display(double light)
{
    return (unsigned char)(clamp(sqrt(larger(light, 0))) * 255 + 0.5);
}

void paint_surface(const lights *l, vector normal, double lit, double open, unsigned char pixel[3])
{
    const double lamp = lit * lamp_on(l, normal), around = l->sky_gain * open;
    const double sky = 0.5 + 0.5 * dot(normal, l->up);
    for (int i = 0; i < 3; i++)
        pixel[i] = display(lamp * LAMP[i] + around * sky * SKY[i] +
                           around * (1 - sky) * GROUND[i]);
}

void paint_background(const lights *l, const hgrid_ray *ray, unsigned char pixel[3])
{
    const double t = clamp(0.5 + 1.4 * dot(vector_of(ray->direction), l->up));
    for (int i = 0; i < 3; i++)
        pixel[i] = display(HORIZON[i] + (ZENITH[i] - HORIZON[i]) * t);
}

/* --- pseudorandom directions ----------------------------------------------------------------- */

/* Returns a pseudorandom number from 0 to 1: every bit of it depends on every bit of x. */
static double hash(uint32_t x)
{
    x = (x ^ (x >> 16)) * UINT32_C(0x7feb352d);
    x = (x ^ (x >> 15)) * UINT32_C(0x846ca68b);
    return (x ^ (x >> 16)) / 4294967296.0;
}

/* Returns the point of the unit circle after a part of a turn. In each quadrant a polynomial approximates the
 * tangent of half the angle, because cos and sin differ between machines. */
static void circle(double turn, double *x, double *y)
{
    const int quadrant = (int)(4 * turn);
    const double f = 4 * turn - quadrant, f2 = f * f;
    const double t = f * (0.785 + f2 * (0.144 + f2 * 0.071)), t2 = t * t;
    const double cosine = (1 - t2) / (1 + t2), sine = 2 * t / (1 + t2);
    *x = quadrant == 0 ? cosine : quadrant == 1 ? -sine : quadrant == 2 ? -cosine : sine;
    *y = quadrant == 0 ? sine : quadrant == 1 ? cosine : quadrant == 2 ? -sine : -cosine;
}

/* Points on a disk, lifted to the hemisphere above it, have a cosine distribution. On the disk they lie like
 * the seeds of a sunflower, rotated by a different angle for each pixel. */
vector scatter(vector normal, uint32_t pixel, int i, int count)
{
    static const double golden = 0.6180339887498949;
    const double radius2 = (i + hash(2 * pixel)) / count;
    const double turn = i * golden + hash(2 * pixel + 1);
    double x, y;
    circle(turn - floor(turn), &x, &y);

    /* Two axes along the surface. */
    const vector across = {0, 0, 1}, along = {1, 0, 0};
    const vector helper = fabs(normal.z) < 0.9 ? across : along;
    const vector first = unit(cross(helper, normal), along), second = cross(normal, first);
    const double radius = sqrt(radius2), height = sqrt(1 - radius2);
    return offset(offset(scale(normal, height), radius * x, first), radius * y, second);
}
