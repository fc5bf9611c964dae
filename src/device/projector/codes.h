/* Codes of a picture, 0..1 (clipped; NaN is 0), to the nearest steps of a panel, halves upwards. */
#ifndef CLT_DEVICE_PROJECTOR_CODES_H
#define CLT_DEVICE_PROJECTOR_CODES_H

#include <stddef.h>
#include <stdint.h>

/* 0..255, and 0..full. */
void clt_codes_to_bytes(const float *codes, size_t count, uint8_t *out);
void clt_codes_to_words(const float *codes, size_t count, int full, uint16_t *out);
/* Three planes of count codes each to pixels 0xRRGGBB. */
void clt_codes_to_pixels(const float *codes, size_t count, uint32_t *out);

#endif
