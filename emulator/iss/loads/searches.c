/* Searches and decisions: quicksort, a heap, primes, a maze, patterns with wild cards, and a net of
   conditions. */

#include "load.inc"

enum { VALUES = 200, WIDTH = 16 };

static uint32_t values[VALUES], heap[VALUES];

static void quicksort(uint32_t *low, uint32_t *high) {
    while (low < high) {
        const uint32_t pivot = low[(high - low) / 2];
        uint32_t *a = low, *b = high;
        while (a <= b) {
            while (*a < pivot) a++;
            while (*b > pivot) b--;
            if (a <= b) {
                const uint32_t other = *a;
                *a++ = *b, *b-- = other;
            }
        }
        quicksort(low, b);
        low = a;
    }
}

static uint32_t heaped(void) {
    uint32_t count = 0, sum = 0;
    for (int i = 0; i < VALUES; i++) {
        uint32_t at = count++;
        heap[at] = values[(i * 77) % VALUES];
        for (; at && heap[(at - 1) / 2] > heap[at]; at = (at - 1) / 2) {
            const uint32_t other = heap[at];
            heap[at] = heap[(at - 1) / 2], heap[(at - 1) / 2] = other;
        }
    }
    while (count) {
        sum = mix(sum, heap[0]), heap[0] = heap[--count];
        for (uint32_t at = 0, child; (child = 2 * at + 1) < count; at = child) {
            if (child + 1 < count && heap[child + 1] < heap[child]) child++;
            if (heap[at] <= heap[child]) break;
            const uint32_t other = heap[at];
            heap[at] = heap[child], heap[child] = other;
        }
    }
    return sum;
}

static uint32_t primes(uint32_t limit) {
    uint32_t count = 0;
    for (uint32_t n = 2; n < limit; n++) {
        uint32_t d = 2;
        while (d * d <= n && n % d) d++;
        count += d * d > n;
    }
    return count;
}

static uint32_t maze(uint32_t *seed) {
    uint8_t wall[WIDTH * WIDTH], queue[WIDTH * WIDTH], distance[WIDTH * WIDTH] = {0};
    for (int i = 0; i < WIDTH * WIDTH; i++) wall[i] = (draw(seed) & 3) == 0;
    int head = 0, tail = 0;
    queue[tail++] = 0, distance[0] = 1;
    while (head < tail) {
        const int at = queue[head++], x = at % WIDTH;
        const int steps[4] = {x ? at - 1 : -1, x < WIDTH - 1 ? at + 1 : -1, at - WIDTH, at + WIDTH};
        for (int i = 0; i < 4; i++) {
            const int to = steps[i];
            if (to < 0 || to >= WIDTH * WIDTH || wall[to] || distance[to]) continue;
            distance[to] = (uint8_t)(distance[at] + 1), queue[tail++] = (uint8_t)to;
        }
    }
    return (uint32_t)tail << 8 | distance[WIDTH * WIDTH - 1];
}

static int matches(const char *pattern, const char *text) {
    for (; *pattern; pattern++, text++) {
        if (*pattern == '*') {
            do
                if (matches(pattern + 1, text)) return 1;
            while (*text++);
            return 0;
        }
        if (!*text || (*pattern != '?' && *pattern != *text)) return 0;
    }
    return !*text;
}

static uint32_t patterns(uint32_t *seed) {
    static const char *const list[] = {"*ab*ba*", "a?b*", "*aa*bb*a", "b*b", "???*a"};
    char text[24];
    for (int i = 0; i < 23; i++) text[i] = (char)('a' + (draw(seed) >> 9 & 1));
    text[23] = 0;
    uint32_t found = 0;
    for (int i = 0; i < 5; i++) found = found << 1 | (uint32_t)matches(list[i], text);
    return found;
}

static uint32_t net(uint32_t *seed) {
    int16_t tokens[8] = {3, 0, 0, 2, 0, 1, 0, 0};
    for (int i = 0; i < 200; i++) {
        const uint32_t r = draw(seed);
        if (r & 1 && tokens[0] > 0 && tokens[5] > 0) tokens[0]--, tokens[1]++;
        if (r & 2 && tokens[1] >= 1) tokens[1]--, tokens[2]++;
        if (r & 4 && tokens[2] > 0 && tokens[3] > 1) tokens[2]--, tokens[3] -= 2, tokens[4]++;
        if (r & 8 && tokens[4] > 0) tokens[4]--, tokens[0]++, tokens[3] += 2, tokens[6]++;
        if (r & 16 && tokens[6] > 2) tokens[6] -= 3, tokens[7]++;
        if (r & 32 && tokens[7] > tokens[6]) tokens[7]--, tokens[5]++;
    }
    uint32_t sum = 0;
    for (int i = 0; i < 8; i++) sum = mix(sum, (uint32_t)tokens[i]);
    return sum;
}

uint32_t load(uint32_t seed, uint32_t rounds) {
    uint32_t sum = 0;
    for (uint32_t round = 0; round < rounds; round++) {
        for (int i = 0; i < VALUES; i++) values[i] = draw(&seed);
        quicksort(values, values + VALUES - 1);
        sum = mix(sum, heaped());
        sum = mix(sum, values[round % VALUES] + primes(300));
        sum = mix(sum, maze(&seed));
        sum = mix(sum, patterns(&seed));
        sum = mix(sum, net(&seed));
    }
    return sum;
}
