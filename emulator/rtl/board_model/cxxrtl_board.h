// A bridged design as CXXRTL's C++ has it, before synthesis: one lane. See settled.h for why eval()
// is called twice before each commit: the design's clocks come out of the bridge's registers.

#pragma once

#include "design.cpp"
#include "lanes.h"

struct Board {
    static constexpr int lanes = 1;
    Bits rx = 1, tx = 1;

    Board() {
        top.p_rx.set<bool>(true);
        settle();
    }

    Bits clock() {
        top.p_rx.set<bool>(rx & 1);
        top.p_clk.set<bool>(true);
        const bool changed = settle();
        top.p_clk.set<bool>(false);
        settle();
        tx = top.p_tx.get<bool>();
        return changed;
    }

private:
    cxxrtl_design::p_top top;

    bool settle() {
        bool changed = false;
        do {
            top.eval();
            top.eval();
        } while (top.commit() && (changed = true));
        return changed;
    }
};
