// The reference MCAP implementation as a program for the test:
//   node reference.mjs indexed FILE   prints what the indexed reader finds, as one JSON object
//   node reference.mjs stream FILE    the same with the linear reader
//   node reference.mjs count FOLDER   how many messages the indexed reader finds in each recording of a folder, after the
//                                     linear one has checked every CRC and found as many; an error is a text instead
//   node reference.mjs write FILE     writes a recording for our reader
import { McapIndexedReader, McapStreamReader, McapWriter } from "@mcap/core";
import { loadDecompressHandlers } from "@mcap/support";
import { readdirSync, readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";

const [, , action, file] = process.argv;

class Collector {
  found = { messages: [], metadata: [], statistics: null, dataEnd: false };
  channels = new Map();
  add(record) {
    if (record.type === "Channel") this.channels.set(record.id, record);
    if (record.type === "Metadata") this.found.metadata.push({ name: record.name, entries: Object.fromEntries(record.metadata) });
    if (record.type === "DataEnd") this.found.dataEnd = true;
    if (record.type === "Statistics") {
      this.found.statistics = { messages: Number(record.messageCount), channels: record.channelCount, chunks: record.chunkCount };
    }
    if (record.type === "Message") {
      this.found.messages.push({
        topic: this.channels.get(record.channelId).topic,
        sequence: record.sequence,
        log_time_ns: Number(record.logTime),
        publish_time_ns: Number(record.publishTime),
        data: Buffer.from(record.data).toString("latin1"),
      });
    }
  }
}

async function readIndexed(bytes, decompressHandlers) {
  const readable = {
    size: async () => BigInt(bytes.length),
    read: async (offset, size) => new Uint8Array(bytes.subarray(Number(offset), Number(offset + size))),
  };
  const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers });
  const collector = new Collector();
  for (const channel of reader.channelsById.values()) collector.add(channel);
  for await (const record of reader.readMetadata()) collector.add(record);
  for await (const record of reader.readMessages()) collector.add(record);
  collector.add(reader.statistics);
  return collector.found;
}

function readStream(bytes, decompressHandlers) {
  const reader = new McapStreamReader({ validateCrcs: true, decompressHandlers });
  const collector = new Collector();
  reader.append(new Uint8Array(bytes));
  for (let record; (record = reader.nextRecord()); ) collector.add(record);
  if (!reader.done()) throw new Error("the file ends too early");
  return collector.found;
}

async function countMessages(folder, decompressHandlers) {
  const counts = {};
  for (const name of readdirSync(folder).filter((entry) => entry.endsWith(".mcap"))) {
    const bytes = readFileSync(join(folder, name));
    try {
      const indexed = (await readIndexed(bytes, decompressHandlers)).messages.length;
      const linear = readStream(bytes, decompressHandlers).messages.length;
      counts[name] = indexed === linear ? indexed : `${indexed} by the index, but ${linear} in the file`;
    } catch (error) {
      counts[name] = String(error);
    }
  }
  return counts;
}

async function write(path) {
  const parts = [];
  let size = 0n;
  const writable = {
    position: () => size,
    write: async (bytes) => {
      parts.push(Buffer.from(bytes));
      size += BigInt(bytes.length);
    },
  };
  const writer = new McapWriter({ writable, chunkSize: 200 });
  await writer.start({ profile: "", library: "reference" });
  const data = new TextEncoder().encode("module m {};");
  const schemaId = await writer.registerSchema({ name: "m::T", encoding: "omgidl", data });
  for (const topic of ["first", "second"]) {
    await writer.registerChannel({ schemaId, topic, messageEncoding: "cdr", metadata: new Map([["by", "reference"]]) });
  }
  for (let i = 0; i < 50; ++i) {
    const message = { channelId: i % 2, sequence: i, logTime: BigInt(1000 + i), publishTime: BigInt(900 + i) };
    await writer.addMessage({ ...message, data: Buffer.from(`message ${i}`) });
  }
  await writer.addMetadata({ name: "origin", metadata: new Map([["key", "value"]]) });
  await writer.end();
  writeFileSync(path, Buffer.concat(parts));
}

if (action === "write") {
  await write(file);
} else if (action === "count") {
  console.log(JSON.stringify(await countMessages(file, await loadDecompressHandlers())));
} else {
  const handlers = await loadDecompressHandlers();
  const bytes = readFileSync(file);
  console.log(JSON.stringify(action === "indexed" ? await readIndexed(bytes, handlers) : readStream(bytes, handlers)));
}
