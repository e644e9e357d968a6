/* SPDX-License-Identifier: BSD-2-Clause */
/* QUEST with sequential rotations and Gaussian elimination; order of operations as in
 * firmware_model/attitude/quest.py. */
#include "quest.h"

#include <math.h>

#define SMALLEST_DETERMINANT 2e-6f /* 0.1 deg between two vectors; see quest.py */

/* Signs of the reference axes: unchanged, or rotated by 180 deg about x, y or z. */
static const float turns[4][3] = {{1, 1, 1}, {1, -1, -1}, {-1, 1, -1}, {-1, -1, 1}};

/* Matrix and right side of equation 4.4.9 for weights with the sum 1. */
static void make_system(float rows[3][4], float b[3][3], const float signs[3]) {
    float p[3][3];
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            p[i][j] = b[i][j] * signs[j];
        }
    }
    float sum = 1.0f + (p[0][0] + p[1][1] + p[2][2]);
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            float twice = p[i][j] + p[j][i];
            rows[i][j] = i == j ? sum - twice : -twice;
        }
    }
    rows[0][3] = p[1][2] - p[2][1];
    rows[1][3] = p[2][0] - p[0][2];
    rows[2][3] = p[0][1] - p[1][0];
}

static float determinant(float m[3][4]) {
    return m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) -
           m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
           m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
}

/* Gaussian elimination with row exchange. */
static void eliminate(float rows[3][4], float solution[3]) {
    for (int column = 0; column < 3; column++) {
        int pivot = column;
        for (int row = column + 1; row < 3; row++) {
            if (fabsf(rows[row][column]) > fabsf(rows[pivot][column])) {
                pivot = row;
            }
        }
        for (int i = 0; i < 4; i++) {
            float kept = rows[column][i];
            rows[column][i] = rows[pivot][i];
            rows[pivot][i] = kept;
        }
        for (int row = column + 1; row < 3; row++) {
            float factor = rows[row][column] / rows[column][column];
            for (int i = column; i < 4; i++) {
                rows[row][i] = rows[row][i] - factor * rows[column][i];
            }
        }
    }
    for (int row = 2; row >= 0; row--) {
        float rest = rows[row][3];
        for (int column = row + 1; column < 3; column++) {
            rest = rest - rows[row][column] * solution[column];
        }
        solution[row] = rest / rows[row][row];
    }
}

bool quest(float quaternion[4], const float (*measured)[3], const float (*reference)[3],
           const float *weights, int count) {
    float b[3][3] = {{0}}, total = 0.0f, systems[4][3][4], determinants[4], r[3];
    int turn = 0;
    if (count < 2) {
        return false;
    }
    for (int star = 0; star < count; star++) {
        for (int i = 0; i < 3; i++) {
            float weighted = weights[star] * measured[star][i];
            for (int j = 0; j < 3; j++) {
                b[i][j] = b[i][j] + weighted * reference[star][j];
            }
        }
        total = total + weights[star];
    }
    if (total <= 0.0f) {
        return false;
    }
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            b[i][j] = b[i][j] / total;
        }
    }
    for (int i = 0; i < 4; i++) {
        make_system(systems[i], b, turns[i]);
        determinants[i] = determinant(systems[i]);
        if (determinants[i] > determinants[turn]) {
            turn = i;
        }
    }
    if (determinants[turn] < SMALLEST_DETERMINANT) {
        return false;
    }
    eliminate(systems[turn], r);
    float squares = 1.0f;
    for (int i = 0; i < 3; i++) {
        squares = squares + r[i] * r[i];
    }
    float w = 1.0f / sqrtf(squares);
    float x = r[0] * w, y = r[1] * w, z = r[2] * w;
    const float back[4][4] = {{x, y, z, w}, {w, -z, y, -x}, {z, w, -x, -y}, {-y, x, w, -z}};
    bool flip = back[turn][3] < 0.0f;
    for (int i = 0; i < 4; i++) {
        float component = i < 3 ? -back[turn][i] : back[turn][i];
        quaternion[i] = flip ? -component : component;
    }
    return true;
}

void dcm(float rotation[3][3], const float quaternion[4]) {
    float x = quaternion[0], y = quaternion[1], z = quaternion[2], w = quaternion[3];
    float diagonal = w * w - (x * x + y * y + z * z);
    float xy = x * y, xz = x * z, yz = y * z, wx = w * x, wy = w * y, wz = w * z;
    rotation[0][0] = diagonal + 2.0f * x * x;
    rotation[0][1] = 2.0f * (xy - wz);
    rotation[0][2] = 2.0f * (xz + wy);
    rotation[1][0] = 2.0f * (xy + wz);
    rotation[1][1] = diagonal + 2.0f * y * y;
    rotation[1][2] = 2.0f * (yz - wx);
    rotation[2][0] = 2.0f * (xz - wy);
    rotation[2][1] = 2.0f * (yz + wx);
    rotation[2][2] = diagonal + 2.0f * z * z;
}
