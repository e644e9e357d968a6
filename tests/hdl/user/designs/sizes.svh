`ifndef SIZES_SVH
`define SIZES_SVH
`define ADDRESS_BITS(c, r) ($clog2(c) + $clog2(r))
`endif
