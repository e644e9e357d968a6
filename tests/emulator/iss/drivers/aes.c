// AES by interrupt: FIPS 197 C.1 both ways, and two blocks in CBC of SP 800-38A F.2.1.
#include "driver.h"

enum { DECRYPT = 1, KEY_BUFFER = 4, XOR_START = 32 };

static volatile bool done;

void AES_IRQHandler(void) {
    AES->IFC = 1;
    done = true;
}

// The registers take the last word first, in big-endian order.
static void write_block(volatile uint32_t *to, const uint32_t *words) {
    for (int i = 3; i >= 0; i--)
        *to = words[i];
}

static void finish_block(uint32_t *words) {
    SLEEP_UNTIL(done);
    done = false;
    for (int i = 3; i >= 0; i--)
        words[i] = AES->DATA;
}

static void aes_init(uint32_t control) {
    CMU->HFCORECLKEN0 |= CMU_HFCORECLKEN0_AES;
    AES->CTRL = control;
    AES->IFC = 1;
    AES->IEN = 1;
    NVIC_EnableIRQ(AES_IRQn);
}

static void block(const uint32_t *in, uint32_t *out) {
    write_block(&AES->DATA, in);
    AES->CMD = 1;
    finish_block(out);
}

static void compare(const char *what, const uint32_t *found, const uint32_t *expected) {
    for (int i = 0; i < 4; i++)
        check(what, found[i], expected[i]);
}

static const uint32_t KEY[] = {0x00010203, 0x04050607, 0x08090A0B, 0x0C0D0E0F};
static const uint32_t PLAIN[] = {0x00112233, 0x44556677, 0x8899AABB, 0xCCDDEEFF};
static const uint32_t CIPHER[] = {0x69C4E0D8, 0x6A7B0430, 0xD8CDB780, 0x70B4C55A};
static const uint32_t CBC_KEY[] = {0x2B7E1516, 0x28AED2A6, 0xABF71588, 0x09CF4F3C};
static const uint32_t CBC_PLAIN[][4] = {
    {0x6BC1BEE2, 0x2E409F96, 0xE93D7E11, 0x7393172A},
    {0xAE2D8A57, 0x1E03AC9C, 0x9EB76FAC, 0x45AF8E51}};
static const uint32_t CBC_CIPHER[][4] = {
    {0x7649ABAC, 0x8119B246, 0xCEE98E9B, 0x12E9197D},
    {0x5086CB9B, 0x507219EE, 0x95DB113A, 0x917678B2}};

int main(void) {
    uint32_t found[4];
    driver_begin();
    aes_init(0);
    write_block(&AES->KEYLA, KEY);
    block(PLAIN, found);
    compare("encrypted", found, CIPHER);
    AES->CTRL = DECRYPT;  // with the key that the encryption has left
    block(CIPHER, found);
    compare("decrypted", found, PLAIN);

    AES->CTRL = KEY_BUFFER | XOR_START;
    write_block(&AES->KEYHA, CBC_KEY);
    write_block(&AES->DATA, KEY);  // the initial vector has the same value
    for (int i = 0; i < 2; i++) {
        write_block(&AES->XORDATA, CBC_PLAIN[i]);  // the last word starts
        finish_block(found);
        compare("CBC", found, CBC_CIPHER[i]);
        write_block(&AES->DATA, found);
    }
    driver_end();
}
