// The design's pins, registers, and lines to cameras and memories, from pins.h.

#pragma once

#include "design.cpp"
#include "pins.h"
#include "sram_model.h"

namespace {

using Top = cxxrtl_design::p_top;

struct Pin {
    const char *name;
    uint32_t initial;
    void (*set)(Top &, uint32_t);
    uint32_t (*get)(const Top &);
};

#define GETTER(port) [](const Top &top) { return top.port.template get<uint32_t>(); }
#define INPUT(name, port, initial) \
    {name, initial, [](Top &top, uint32_t value) { top.port.template set<uint32_t>(value); }, \
     GETTER(port)},
#define OUTPUT(name, port) {name, 0, nullptr, GETTER(port)},

const Pin PIN_TABLE[] = {PINS};

// A register of the design, for upsets.
struct Register {
    const char *name;
    int32_t bits;
    void (*flip)(Top &, int32_t);
    const uint32_t *(*levels)(const Top &);
};

template <size_t Bits> void flip_bit(cxxrtl::wire<Bits> &wire, int32_t bit) {
    const uint32_t mask = 1u << bit % 32;
    wire.curr.data[bit / 32] ^= mask;
    wire.next.data[bit / 32] ^= mask;
}

#define REGISTER(name, port, bits) \
    {name, bits, [](Top &top, int32_t bit) { flip_bit(top.port, bit); }, \
     [](const Top &top) -> const uint32_t * { return top.port.curr.data; }},

const Register REGISTER_TABLE[] = {REGISTERS {nullptr, 0, nullptr, nullptr}};
const int32_t REGISTER_COUNT = (int32_t)(sizeof REGISTER_TABLE / sizeof *REGISTER_TABLE) - 1;

// The lines of camera number N.
template <int N> struct Camera;

#define CAMERA(number, clock_, data_, line_, frame_) \
    template <> struct Camera<number> { \
        template <class Model> static void clock(Model &top, bool level) { \
            top.clock_.template set<bool>(level); \
        } \
        template <class Model> static void data(Model &top, uint8_t value) { \
            top.data_.template set<uint8_t>(value); \
        } \
        template <class Model> static void line(Model &top, bool level) { \
            top.line_.template set<bool>(level); \
        } \
        static void frame(Top &top, bool level) { (void)top, frame_; } \
    };
CAMERAS

// The lines of memory number N.
template <int N> struct Memory;

#define MEMORY(number, a, d_i, d_o, d_oe, ce_n, oe_n, we_n) \
    template <> struct Memory<number> { \
        template <class Model> static SramPins pins(const Model &top) { \
            return SramPins( \
                top.a.template get<uint32_t>(), top.ce_n.template get<uint32_t>(), \
                top.oe_n.template get<uint32_t>(), top.we_n.template get<uint32_t>(), \
                top.d_oe.template get<uint32_t>(), top.d_o.template get<uint32_t>()); \
        } \
        template <class Model> static void offer(Model &top, uint8_t value) { \
            top.d_i.template set<uint8_t>(value); \
        } \
        template <class Model> static uint8_t offered(const Model &top) { \
            return top.d_i.template get<uint8_t>(); \
        } \
    };
MEMORIES

}  // namespace
