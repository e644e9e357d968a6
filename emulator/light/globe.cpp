// Light of a sphere: globe.py, in blocks of lines of sight.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>

namespace {

constexpr int BLOCK = 512;

struct Globe {
    float limit, distance, square, twilight, cosine, sine, per_height, unevenness;
    float centre[3], closest[3], sun[3], sine_series[6], exp2_series[7];
    float to_whole, log2_e, smallest;
    int32_t waves;
    const float *table;  // of each wave: its vector (3,) and its phase
};

template <int SIZE>
inline float series(const float (&coefficients)[SIZE], float x) {
    float value = coefficients[SIZE - 1];
    for (int n = SIZE - 2; n >= 0; --n) value = value * x + coefficients[n];
    return value;
}

inline float exponential(const Globe &globe, float x) {
    const float wanted = x * globe.log2_e;
    const float power = wanted > globe.smallest ? wanted : globe.smallest;
    const float whole = (power + globe.to_whole) - globe.to_whole;
    const int32_t bits = ((int32_t)whole + 127) << 23;
    float scale;
    std::memcpy(&scale, &bits, sizeof scale);
    return series(globe.exp2_series, power - whole) * scale;
}

// The lines of sight of a block that meet the globe.
struct Met {
    int count;
    float x[BLOCK], y[BLOCK], z[BLOCK], cosine[BLOCK], pixel[BLOCK], light[BLOCK];
};

void add_daylight(const Globe &globe, Met &met) {
    const float *closest = globe.closest, *sun = globe.sun;
    for (int n = 0; n < met.count; ++n) {
        const float cosine = met.cosine[n];
        const float square = 1.0f - globe.square * (1.0f - cosine * cosine);
        const float along = globe.distance * cosine - std::sqrt(square > 0.0f ? square : 0.0f);
        const float x = met.x[n] * along - closest[0];
        const float y = met.y[n] * along - closest[1];
        const float z = met.z[n] * along - closest[2];
        met.x[n] = x, met.y[n] = y, met.z[n] = z;
        const float sine = x * sun[0] + y * sun[1] + z * sun[2];
        met.light[n] = (sine + std::sqrt(sine * sine + globe.twilight)) * 0.5f;
    }
}

// Multiplies by the share of each pixel that the surface and its glow fill.
void cut_at_limb(const Globe &globe, Met &met) {
    float above[BLOCK], share[BLOCK];
    for (int n = 0; n < met.count; ++n) {
        above[n] = (globe.cosine - met.cosine[n]) / (globe.sine * met.pixel[n]);
        const float low = 0.5f - above[n] > 0.0f ? 0.5f - above[n] : 0.0f;
        share[n] = low < 1.0f ? low : 1.0f;
    }
    for (int n = 0; n < met.count && globe.per_height != 0.0f; ++n) {
        if (!(above[n] > -0.5f)) continue;
        const float heights = met.pixel[n] * globe.per_height;
        const float low = std::max(above[n] - 0.5f, 0.0f) * heights;
        const float high = std::max(above[n] + 0.5f, 0.0f) * heights;
        share[n] += (exponential(globe, -low) - exponential(globe, -high)) / heights;
    }
    for (int n = 0; n < met.count; ++n) met.light[n] = met.light[n] * share[n];
}

void add_pattern(const Globe &globe, Met &met) {
    float pattern[BLOCK] = {};
    for (int wave = 0; wave < globe.waves; ++wave) {
        const float *row = globe.table + 4 * wave;
        const float a = row[0], b = row[1], c = row[2], phase = row[3];
        const float to_whole = globe.to_whole;
        for (int n = 0; n < met.count; ++n) {
            const float turns = met.x[n] * a + met.y[n] * b + met.z[n] * c + phase;
            const float r = turns - ((turns + to_whole) - to_whole);
            const float sine = r * series(globe.sine_series, r * r);
            pattern[n] = pattern[n] + (1.0f - 2.0f * (sine * sine));
        }
    }
    for (int n = 0; n < met.count; ++n) {
        const float factor = pattern[n] * globe.unevenness + 1.0f;
        met.light[n] = met.light[n] * (factor > 0.0f ? factor : 0.0f);
    }
}

}  // namespace

// Numbers and light of those of ``count`` lines of sight (count, 3) that meet the globe; returns how
// many.
extern "C" int64_t light_globe(const Globe *globe, const float *vectors, const float *pixel_rad,
                               int64_t count, int64_t *hit, float *light) {
    const float *centre = globe->centre;
    Met met;
    int64_t found = 0;
    for (int64_t first = 0; first < count; first += BLOCK) {
        const int size = (int)std::min<int64_t>(BLOCK, count - first);
        met.count = 0;
        for (int n = 0; n < size; ++n) {
            const float *sight = vectors + 3 * (first + n);
            const float cosine = sight[0] * centre[0] + sight[1] * centre[1] + sight[2] * centre[2];
            if (!(cosine > globe->limit)) continue;
            hit[found + met.count] = first + n;
            met.x[met.count] = sight[0], met.y[met.count] = sight[1], met.z[met.count] = sight[2];
            met.cosine[met.count] = cosine;
            met.pixel[met.count++] = pixel_rad[first + n];
        }
        if (!met.count) continue;
        add_daylight(*globe, met);
        cut_at_limb(*globe, met);
        if (globe->waves) add_pattern(*globe, met);
        std::copy(met.light, met.light + met.count, light + found);
        found += met.count;
    }
    return found;
}
