// Encryption accelerator. EFM32GG Reference Manual, chapter 31.
//
// DATA and the two keys are 128-bit shift registers: a write enters at the top and moves the others
// down, a read takes the lowest word, which enters at the top again; any of the four addresses of a
// key does. Assumed: writes while it runs are lost; after AES-256 the upper half of the key has the
// last round's key, since decryption begins with it.
#include "efm32gg/memory/aes_rounds.h"
#include "efm32gg/memory/dma.h"

namespace efm32gg {

using namespace aes;

namespace {

constexpr int SOURCE = 49;
// Requests, by SIGSEL; all are set at the end and each is cleared by its access (31.3.4).
enum Request { DATA_WRITE, XORDATA_WRITE, DATA_READ, KEY_WRITE, REQUESTS };
// HFCORECLK cycles of a block (31.3).
constexpr int64_t CYCLES_128 = 54, CYCLES_256 = 75;

struct ShiftRegister {
    uint32_t words[4] = {};

    void push(uint32_t word) {
        for (int n = 0; n < 3; n++)
            words[n] = words[n + 1];
        words[3] = word;
    }
    uint32_t rotate() {
        const uint32_t lowest = words[0];
        push(lowest);
        return lowest;
    }
};

class Aes : public Peripheral {
public:
    using Peripheral::Peripheral;

    void reset() override {
        Peripheral::reset();
        part.cancel(done);
        data = low = high = {};
        started = stalled = false;
        begin_access();
    }

    uint32_t peek(uint32_t offset) const override {
        switch (offset) {
        case DATA: case XORDATA: return data.words[0];
        case KEYLA: case KEYLB: case KEYLC: case KEYLD: return low.words[0];
        case KEYHA: case KEYHB: case KEYHC: case KEYHD: return high.words[0];
        }
        return Peripheral::peek(offset);
    }

    uint32_t read(uint32_t offset) override {
        if (ShiftRegister *shifted = register_at(offset)) {
            if (shifted == &data)
                part.dma->request(SOURCE, DATA_READ, false);
            return shifted->rotate();
        }
        return peek(offset);
    }

    void write(uint32_t offset, uint32_t value) override {
        if (ShiftRegister *shifted = register_at(offset)) {
            if (started) return part.log_once("AES: a write while it runs is lost");
            shifted->push(offset == XORDATA ? shifted->words[0] ^ value : value);
            written(offset, shifted);
            return;
        }
        Peripheral::write(offset, value);
        if (offset == CTRL)
            begin_access();
        if (offset == CMD && value & CMD_STOP)
            stop();
        else if (offset == CMD && value & CMD_START)
            start();
    }

    void clocks_changed() override {
        if (stalled && clock_now().runs()) {
            stalled = false;
            part.schedule(done, part.now());
        }
    }

private:
    ShiftRegister data, low, high;
    int data_writes = 0, xor_writes = 0;
    bool started = false, stalled = false;
    Event done = Event::of<&Aes::on_done>(this);

    ShiftRegister *register_at(uint32_t offset) {
        if (offset == DATA || offset == XORDATA) return &data;
        if (offset >= KEYLA && offset <= KEYLD) return &low;
        return offset >= KEYHA && offset <= KEYHD ? &high : nullptr;
    }

    void begin_access() {
        data_writes = xor_writes = 0;
        for (int n = 0; n < REQUESTS; n++)
            part.dma->request(SOURCE, n, false);
    }

    // The fourth write starts, if the control register says so.
    void written(uint32_t offset, const ShiftRegister *shifted) {
        if (shifted != &data) {
            if (shifted == &high)
                part.dma->request(SOURCE, KEY_WRITE, false);
            return;
        }
        const bool plain = offset == DATA;
        part.dma->request(SOURCE, plain ? DATA_WRITE : XORDATA_WRITE, false);
        int &writes = plain ? data_writes : xor_writes;
        writes = (writes + 1) % 4;
        if (!writes && reg(CTRL) & (plain ? CTRL_DATASTART : CTRL_XORSTART))
            start();
    }

    void start() {
        if (started) return;
        data_writes = xor_writes = 0;
        const bool wide = reg(CTRL) & CTRL_AES256;
        if (reg(CTRL) & CTRL_KEYBUFEN && !wide)
            low = high;
        started = true;
        reg(STATUS) = STATUS_RUNNING;
        const Rate rate = clock_now();
        stalled = !rate.runs();
        if (!stalled)
            part.schedule_after(done, rate.span(wide ? CYCLES_256 : CYCLES_128));
    }

    void stop() {
        part.cancel(done);
        started = stalled = false;
        reg(STATUS) = 0;
    }

    // Byte n in the order of FIPS 197 of a register: its highest byte first, or with BYTEORDER its
    // lowest.
    int place(int n) const { return reg(CTRL) & CTRL_BYTEORDER ? n : 15 - n; }

    aes_rounds::Block bytes(const ShiftRegister &from) const {
        aes_rounds::Block block;
        for (int n = 0; n < 16; n++)
            block[n] = (uint8_t)(from.words[place(n) / 4] >> place(n) % 4 * 8);
        return block;
    }

    void put_bytes(ShiftRegister &to, const aes_rounds::Block &block) const {
        to = {};
        for (int n = 0; n < 16; n++)
            to.words[place(n) / 4] |= (uint32_t)block[n] << place(n) % 4 * 8;
    }

    void get_key(const ShiftRegister &from, uint32_t *words) const {
        const aes_rounds::Block block = bytes(from);
        for (int n = 0; n < 16; n++)
            words[n / 4] = words[n / 4] << 8 | block[n];
    }

    void put_key(ShiftRegister &to, const uint32_t *words) const {
        aes_rounds::Block block;
        for (int n = 0; n < 16; n++)
            block[n] = (uint8_t)(words[n / 4] >> (24 - n % 4 * 8));
        put_bytes(to, block);
    }

    void on_done(int64_t) {
        if (!clock_now().runs()) {
            stalled = true;
            return;
        }
        const bool wide = reg(CTRL) & CTRL_AES256, decrypt = reg(CTRL) & CTRL_DECRYPT;
        aes_rounds::Schedule schedule(wide ? 8 : 4);
        uint32_t key[8] = {};
        // The half whose words the operation uses first is the upper one.
        get_key(wide ? high : low, key + (wide && decrypt ? 4 : 0));
        if (wide)
            get_key(low, key + (decrypt ? 0 : 4));
        if (decrypt)
            schedule.expand_back(key);
        else
            schedule.expand(key);
        const aes_rounds::Block block = bytes(data);
        put_bytes(data, decrypt ? schedule.decrypt(block) : schedule.encrypt(block));
        const uint32_t *left = decrypt ? schedule.first() : schedule.last();
        put_key(wide ? high : low, left + (wide && !decrypt ? 4 : 0));
        if (wide)
            put_key(low, left + (decrypt ? 4 : 0));
        started = false;
        reg(STATUS) = 0;
        raise(IF_DONE);
        for (int n = 0; n < REQUESTS; n++)
            part.dma->request(SOURCE, n, true);
    }
};

}  // namespace

void add_aes(Part &part) { part.add(new Aes(part, instance::AES)); }

}  // namespace efm32gg
