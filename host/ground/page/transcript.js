// All that was said to the device and by it: as a recording, and as tables of it.

import { make, save } from "./dom.js";
import { fetched } from "./server.js";

export class Transcript {
  // `path` leads to the target, `tell(text, kind)` tells what went wrong.
  constructor(place, about, path, tell) {
    const { recording, parquet } = about.missing;
    const name = about.device.toLowerCase();
    const button = (text, id, call, end, why) =>
      make("button", {
        textContent: text,
        id,
        type: "button",
        disabled: Boolean(why),
        title: why ?? "",
        onclick: async () => {
          try {
            save(await (await fetched(`${path}/${call}`)).blob(), `${name}.${end}`);
          } catch (error) {
            tell(`${text}\n  ${error.message}`, "bad");
          }
        },
      });
    place.append(
      make(
        "div",
        { className: "row" },
        button("Save recording", "recording", "recording", "rec", recording),
        button("Save as CSV", "said-csv", "said/csv", "csv", recording),
        button("Save as Parquet", "said-parquet", "said/parquet", "parquet", recording ?? parquet),
      ),
    );
    const why = [recording, parquet].filter(Boolean).join("; ");
    if (why) place.append(make("p", { className: "quiet", textContent: why }));
  }
}
