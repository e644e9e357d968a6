// npm serialport; words: the kind of the port, and its path

const { SerialPort } = require("serialport");

const port = new SerialPort({ path: process.argv[3], baudRate: 57600 });
let data = Buffer.alloc(0);
port.on("data", (part) => {
  data = Buffer.concat([data, part]);
  if (data.length < 12) return;
  console.log(data.subarray(2, 6).toString("hex"));
  port.close();
});
port.write(Buffer.from("1f7f801fff", "hex"));
