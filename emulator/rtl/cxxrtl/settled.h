// The design and its SRAMs, settled after each change of an input.
//
// design.cpp is CXXRTL's output. Its eval() computes outputs and the registers' next values;
// commit() makes those current and returns whether any changed. Outputs follow a register change
// one eval() later, and an asynchronous reset takes one more, hence settle(). eval() detects edges
// at its start, so an edge that it produces itself, on a clock that is not a pin, needs another
// eval() before the commit. An edge of a register counts after its commit (edges.py), so what it
// clocks samples the new levels of the other registers, as in Verilog and VHDL.

#pragma once

#include "lines.h"

#include <algorithm>
#include <cstring>
#include <utility>
#include <vector>

namespace {

// Most commits at one instant; a design that needs more oscillates.
constexpr int MOST_ROUNDS = 1000;

class Settled {
public:
    Settled(uint8_t *const *memories, const SramTiming &timing, int64_t keep) : log(keep) {
        for (int n = 0; n < MEMORY_COUNT; n++)
            srams.emplace_back(memories[n], timing, log, n);
        for (const Pin &pin : PIN_TABLE)
            if (pin.set)
                pin.set(top, pin.initial);
        settle(0);
    }

    Top top;
    ViolationLog log;
    bool unsettled = false;  // the design oscillates

    void set(const Pin &pin, uint32_t value, int64_t now) {
        pin.set(top, value);
        settle(now);
    }

    void flip(const Register &target, int32_t bit, int64_t now) {
        target.flip(top, bit);
        settle(now);
    }

    void power(int memory, bool on, int64_t now) {
        srams[memory].power(on);
        settle(now);
    }

protected:
    std::vector<Sram> srams;

    bool settle(int64_t time) { return settle(top, time); }

    // Settles the design and the memories at `time`; returns whether any register, or any pin of a
    // memory, changed.
    template <class Model> bool settle(Model &top, int64_t time) {
        constexpr auto memories = std::make_integer_sequence<int, MEMORY_COUNT>();
        bool changed = settle_registers(top);
        changed |= drive_memories(top, time, memories);
        if constexpr (FOREIGN) {
            // What the memories offer may pass through the design to any pin.
            for (int rounds = 0; offer(top, memories) && !unsettled; rounds++) {
                changed |= settle_registers(top);
                drive_memories(top, time, memories);
                unsettled |= rounds > MOST_ROUNDS;
            }
        } else {
            offer(top, memories);
#ifdef BUS_HIGH
            if (std::any_of(srams.begin(), srams.end(), [](auto &sram) { return sram.reads(); }))
                eval(top);
#endif
        }
        const uint32_t now_contended = CONTENTION;
        if (now_contended & ~contention)
            log.add({WIRE_CONTENTION, time, 0, now_contended, 0, -1});
        contention = now_contended;
        return changed;
    }

    template <class Model> bool settle_registers(Model &top) {
        bool changed = false;
        if constexpr (!std::is_same_v<Model, Top>)
            top.keep();
        eval(top);
        for (int rounds = 0; commit(top); rounds++) {
            changed = true;
            eval(top);
            if (rounds > MOST_ROUNDS) {
                unsettled = true;
                break;
            }
        }
        return changed;
    }

    template <class Model> void eval(Model &top) {
        eval_once(top);
        if (derived_edge(top))
            eval_once(top);
    }

    // Not inlined: several copies of a large design would exceed the processor's instruction cache,
    // and take half a minute to compile.
    template <class Model> __attribute__((noinline, flatten)) static void eval_once(Model &top) {
        top.Model::eval(nullptr);
    }
    template <class Model> __attribute__((noinline, flatten)) static bool commit(Model &top) {
        return top.Model::commit();
    }

    // Only registers and the external bus of a shipped design depend on the memories.
    template <class Model, int... N>
    bool drive_memories(Model &top, int64_t time, std::integer_sequence<int, N...>) {
        bool moved = false;
        ((moved |= srams[N].drive(time, Memory<N>::pins(top))), ...);
        return moved;
    }

    // Returns whether the memories offer anything else than before.
    template <class Model, int... N>
    bool offer(Model &top, std::integer_sequence<int, N...>) {
        bool moved = false;
        if constexpr (FOREIGN)
            ((moved |= Memory<N>::offered(top) != srams[N].bus()), ...);
        (Memory<N>::offer(top, srams[N].bus()), ...);
        return moved;
    }

    void sample(int64_t time) {
        for (Sram &sram : srams)
            sram.sample(time);
    }

    bool writes() const {
        return std::any_of(srams.begin(), srams.end(), [](auto &sram) { return sram.writes(); });
    }

    template <class Model> static uint32_t acknowledges(const Model &top) { return ACKNOWLEDGES; }

    // Settle after an edge of camera N's clock. A variant computes only what the edge affects,
    // unless registers are in reset; see clock_steps.py. Without `compare`, the result of
    // settle_rise has no meaning.
    template <int N> bool settle_rise(Top &top, int64_t time, bool compare) {
        (void)compare;
        return settle(top, time);
    }
    template <int N> bool settle_fall(Top &top, int64_t time) { return settle(top, time); }

    template <int N, class Model> bool settle_rise(Model &top, int64_t time, bool compare) {
        constexpr std::integral_constant<int, N> camera;
        if (top.in_reset(camera))
            return settle_in_reset(top, time);
        const bool changed =
            compare ? top.template rise<true>(camera) : top.template rise<false>(camera);
        if (top.in_reset(camera))
            return settle_in_reset(top, time) | changed;
        const bool moved = follow<N>(top, time);
        return changed || (FOREIGN && moved);
    }

    template <int N, class Model> bool settle_fall(Model &top, int64_t time) {
        constexpr std::integral_constant<int, N> camera;
        if (top.in_reset(camera))
            return settle_in_reset(top, time);
        top.fall(camera);
        return follow<N>(top, time) && FOREIGN;
    }

    template <class Model>
    __attribute__((noinline)) bool settle_in_reset(Model &top, int64_t time) {
        return settle(top, time);
    }

    // Updates the memories whose pins the clock of a camera can change; returns whether any did.
    template <int N, class Model> bool follow(Model &top, int64_t time) {
        return follow<N>(top, time, std::make_integer_sequence<int, MEMORY_COUNT>());
    }
    template <int N, class Model, int... M>
    bool follow(Model &top, int64_t time, std::integer_sequence<int, M...>) {
        bool moved = false;
        ((moved |= follow_one<N, M>(top, time)), ...);
        return moved;
    }
    template <int N, int M, class Model> bool follow_one(Model &top, int64_t time) {
        bool moved = false;
        if constexpr (Model::may_move(std::integral_constant<int, N>(), M)) {
            moved = srams[M].drive(time, Memory<M>::pins(top));
            Memory<M>::offer(top, srams[M].bus());
        }
        return moved;
    }

private:
    uint32_t contention = 0;
};

}  // namespace
