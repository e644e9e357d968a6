/* Data by the byte: a Huffman code, and a coder that replaces what came before by its place. */

#include "load.inc"

enum { BYTES = 512, SYMBOLS = 16 };

static uint8_t text[BYTES], packed[2 * BYTES], back[BYTES];

static uint32_t huffman(void) {
    uint16_t weight[2 * SYMBOLS], parent[2 * SYMBOLS];
    uint32_t bits = 0;
    for (int i = 0; i < 2 * SYMBOLS; i++) weight[i] = 0, parent[i] = 0;
    for (int i = 0; i < BYTES; i++) weight[text[i] & 15]++;
    for (int made = SYMBOLS; made < 2 * SYMBOLS - 1; made++) {
        int least = -1, next = -1;
        for (int i = 0; i < made; i++) {
            if (parent[i]) continue;
            if (least < 0 || weight[i] < weight[least]) next = least, least = i;
            else if (next < 0 || weight[i] < weight[next]) next = i;
        }
        weight[made] = (uint16_t)(weight[least] + weight[next]);
        parent[least] = parent[next] = (uint16_t)made;
    }
    for (int i = 0; i < BYTES; i++)
        for (int at = text[i] & 15; parent[at]; at = parent[at]) bits++;
    return bits;
}

static int pack(void) {
    int length = 0;
    for (int at = 0; at < BYTES;) {
        int best = 0, from = 0;
        for (int start = at > 63 ? at - 63 : 0; start < at; start++) {
            int run = 0;
            while (run < 60 && at + run < BYTES && text[start + run] == text[at + run]) run++;
            if (run > best) best = run, from = start;
        }
        if (best > 2) {
            packed[length++] = (uint8_t)(128 + at - from), packed[length++] = (uint8_t)best, at += best;
        } else {
            packed[length++] = text[at++];
        }
    }
    return length;
}

static int unpack(int length) {
    int at = 0;
    for (int i = 0; i < length; i++) {
        if (packed[i] < 128) {
            back[at++] = packed[i];
        } else {
            const int from = at - (packed[i] - 128), run = packed[++i];
            for (int k = 0; k < run; k++) back[at + k] = back[from + k];
            at += run;
        }
    }
    return at;
}

uint32_t load(uint32_t seed, uint32_t rounds) {
    uint32_t sum = 0;
    for (uint32_t round = 0; round < rounds; round++) {
        for (int i = 0; i < BYTES; i++)
            text[i] = (draw(&seed) & 3) && i > 20 ? text[i - 1 - (int)(seed & 7)] : (uint8_t)(seed >> 8 & 15);
        const int length = pack();
        if (unpack(length) != BYTES) return 0;
        for (int i = 0; i < BYTES; i++)
            if (back[i] != text[i]) return 0;
        sum = mix(mix(sum, (uint32_t)length), huffman());
    }
    return sum;
}
