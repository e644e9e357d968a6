// Saves the recording, and the table of its messages.

import { button, note, row } from "./dom.js";
import { saveFile } from "./server.js";

export class Transcript {
  constructor(place, about, path, report) {
    const { recording, parquet } = about.missing;
    const name = about.device.toLowerCase();
    const saves = (text, id, call, end, why) =>
      button(text, id, () => saveFile(`${path}/${call}`, `${name}.${end}`, report), why);
    place.append(
      row(
        saves("Save recording", "recording", "recording", "rec", recording),
        saves("Save as CSV", "transcript-csv", "transcript/csv", "csv", recording),
        saves("Save as Parquet", "transcript-parquet", "transcript/parquet", "parquet", recording ?? parquet),
      ),
    );
    const why = [recording, parquet].filter(Boolean).join("; ");
    if (why) place.append(note(why));
  }
}
