/* SPDX-License-Identifier: BSD-2-Clause */
/* Functions in plain single-precision operations, the same on every machine.
 *
 * The order of operations is that of firmware_model/attitude/float_functions.py, bit for bit. */
#pragma once

/* Of -1 to 1; 0 to pi. */
float arc_cosine(float x);

/* -pi to pi. */
float arc_tangent(float y, float x);

float sine(float x);
float cosine(float x);
