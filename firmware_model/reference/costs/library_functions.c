/* SPDX-License-Identifier: BSD-2-Clause */
/* The functions of float_functions.h, implemented by the C library. */
#include "float_functions.h"

#include <math.h>

float arc_cosine(float x) {
    return acosf(x);
}

float arc_tangent(float y, float x) {
    return atan2f(y, x);
}

float sine(float x) {
    return sinf(x);
}

float cosine(float x) {
    return cosf(x);
}
