/* Monotone cubic interpolation (Fritsch & Carlson 1980, with the slopes of Fritsch & Butland 1984): continuous with its
 * first derivative, through every point, and rising wherever the points rise. */
#ifndef CLT_IMAGE_PCHIP_H
#define CLT_IMAGE_PCHIP_H

/* n >= 2 points (x[i], y[i]), x ascending; x NULL means i / (n - 1). Beyond the ends the value stays that of the end.
 */
double clt_pchip_at(const double *x, const double *y, int n, double at);
/* The x at which the interpolation of ascending y reaches `value`; the ends' x beyond them. */
double clt_pchip_inverse(const double *x, const double *y, int n, double value);

#endif
