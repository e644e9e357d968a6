// npm i2c-bus

const bus = require("i2c-bus").openSync(Number(process.argv[2].replace("/dev/i2c-", "")));
const data = Buffer.alloc(4);
bus.readI2cBlockSync(0x1a, 0x80, 4, data);
let last = "present";
try {
  bus.readByteSync(0x33, 0x83);
} catch (error) {
  last = error.code === "ENXIO" ? "absent" : error.message;
}
console.log(data.toString("hex"), bus.readByteSync(0x1a, 0x83).toString(16).padStart(2, "0"), last);
bus.closeSync();
