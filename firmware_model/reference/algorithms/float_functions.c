/* SPDX-License-Identifier: BSD-2-Clause */
/* Arc cosine, arc tangent, sine and cosine: fits and order of operations are those of
 * firmware_model/attitude/float_functions.py. Do not contract them to fused operations. */
#include "float_functions.h"

#include <math.h>
#include <stdint.h>

#define PI 0x1.921fb6p+1f
#define HALF_PI 0x1.921fb6p+0f
#define QUARTER_PI 0x1.921fb6p-1f
#define HALF_PI_REST -0x1.777a5cp-25f /* pi / 2 - HALF_PI */

/* Horner's scheme over coefficients of ascending powers. */
static float polynomial(const float *coefficients, int count, float x) {
    float value = x * coefficients[count - 1];
    for (int i = count - 2; i > 0; i--) {
        value = (value + coefficients[i]) * x;
    }
    return value + coefficients[0];
}

float arc_cosine(float x) {
    static const float fit[] = {0.166667506f, 0.0749534369f, 0.0454662591f, 0.0241948012f,
                                0.0421460979f};
    float size = fabsf(x);
    if (size <= 0.5f) {
        float square = x * x;
        float sine = x + x * (square * polynomial(fit, 5, square));
        return HALF_PI - (sine - HALF_PI_REST);
    }
    float square = (1.0f - size) * 0.5f;
    float root = sqrtf(square);
    float sine = root + root * (square * polynomial(fit, 5, square));
    float twice = sine + sine;
    return x > 0.0f ? twice : PI - twice;
}

float arc_tangent(float y, float x) {
    static const float fit[] = {-0.333333164f, 0.19998534f, -0.14244549f, 0.106004909f,
                                -0.0609358028f};
    float across = fabsf(x), along = fabsf(y);
    int steep = along > across;
    float low = steep ? across : along, high = steep ? along : across;
    float base = low / (high == 0.0f ? 1.0f : high);
    int wide = base > 0.41421357f;
    if (wide) {
        base = (base - 1.0f) / (base + 1.0f);
    }
    float square = base * base;
    float angle = base + base * (square * polynomial(fit, 5, square));
    if (wide) {
        angle = QUARTER_PI + angle;
    }
    if (steep) {
        angle = HALF_PI - angle;
    }
    if (x < 0.0f) {
        angle = PI - angle;
    }
    return y < 0.0f ? -angle : angle;
}

/* Sine of the angle plus `ahead` quarters of a turn. */
static float wave(float x, int ahead) {
    static const float sines[] = {-0.166666552f, 0.00833215751f, -0.000195143773f};
    static const float cosines[] = {0.041666653f, -0.00138877111f, 2.44742641e-05f};
    /* pi / 2; the first two parts have so few bits that their multiples are exact */
    static const float parts[] = {1.5703125f, 4.837512969970703e-4f, 7.549790126404332e-08f};
    float turns = x * 0x1.45f306p-1f;
    int32_t quarters = (int32_t)(turns + (turns < 0.0f ? -0.5f : 0.5f));
    float count = (float)quarters, rest = x;
    for (int i = 0; i < 3; i++) {
        rest = rest - count * parts[i];
    }
    float square = rest * rest, size;
    int32_t quadrant = (quarters + ahead) & 3;
    if (quadrant & 1) {
        size = 1.0f - (square * 0.5f - square * (square * polynomial(cosines, 3, square)));
    } else {
        size = rest + rest * (square * polynomial(sines, 3, square));
    }
    return quadrant & 2 ? -size : size;
}

float sine(float x) {
    return wave(x, 0);
}

float cosine(float x) {
    return wave(x, 1);
}
