/* Floating point without a unit for it: bodies that attract one another, in double precision, and
   statistics in single. */

#include "load.inc"

enum { BODIES = 4 };

struct body {
    double x[3], v[3], mass;
};

static double root(double x) {
    double y = x > 1 ? x : 1;
    for (int i = 0; i < 20; i++) {
        const double next = 0.5 * (y + x / y);
        if (next >= y) break;
        y = next;
    }
    return y;
}

static void advance(struct body *bodies, double dt) {
    for (int i = 0; i < BODIES; i++)
        for (int k = i + 1; k < BODIES; k++) {
            double d[3], square = 0.01;
            for (int n = 0; n < 3; n++) d[n] = bodies[i].x[n] - bodies[k].x[n], square += d[n] * d[n];
            const double pull = dt / (square * root(square));
            for (int n = 0; n < 3; n++) {
                bodies[i].v[n] -= d[n] * bodies[k].mass * pull;
                bodies[k].v[n] += d[n] * bodies[i].mass * pull;
            }
        }
    for (int i = 0; i < BODIES; i++)
        for (int n = 0; n < 3; n++) bodies[i].x[n] += dt * bodies[i].v[n];
}

uint32_t load(uint32_t seed, uint32_t rounds) {
    struct body bodies[BODIES];
    float mean = 0, square = 0;
    uint32_t sum = 0;
    for (int i = 0; i < BODIES; i++) {
        for (int n = 0; n < 3; n++) {
            bodies[i].x[n] = (double)(draw(&seed) & 0xFFFF) / 4096;
            bodies[i].v[n] = (double)(draw(&seed) & 0xFFFF) / 65536;
        }
        bodies[i].mass = 1 + i;
    }
    for (uint32_t round = 0; round < rounds; round++) {
        advance(bodies, 0.01);
        const float value = (float)bodies[round & 3].x[0];
        mean += (value - mean) / (float)(round + 1), square += value * value;
        sum = mix(sum, (uint32_t)(int32_t)(bodies[0].x[0] * 1000)) + (uint32_t)(int32_t)(mean * 100);
    }
    return mix(sum, (uint32_t)square);
}
