// Copyright 2026 The linkage_ros authors
// SPDX-License-Identifier: Apache-2.0
// Prints every message of a log, one JSON object a line, as Foxglove's packages decode it; before
// that, what is wrong with the file. Usage: node read.mjs LOG.mcap

import { open } from 'node:fs/promises';

import { parse } from '@foxglove/rosmsg';
import { MessageReader } from '@foxglove/rosmsg2-serialization';
import zstd from '@foxglove/wasm-zstd';
import { McapIndexedReader, McapStreamReader } from '@mcap/core';

await zstd.isLoaded;
const decompressHandlers = {
  zstd: (data, size) => new Uint8Array(zstd.decompress(data, Number(size))),
};
const file = await open(process.argv[2]);
const faults = [];
const demand = (holds, words) => {
  if (!holds) faults.push(words);
};

// ---------------------------------------------------------------- front to back

const bytes = new Uint8Array(await file.readFile());
const stream = new McapStreamReader({ includeChunks: true, validateCrcs: true, decompressHandlers });
const found = { Chunk: [], Metadata: [], Attachment: [], Message: 0, MessageIndex: 0 };
const counts = new Map();
let first, last;
stream.append(bytes);
for (let record; (record = stream.nextRecord()); ) {
  if (Array.isArray(found[record.type])) found[record.type].push(record);
  else if (record.type in found) found[record.type] += 1;
  if (record.type === 'Message') {
    counts.set(record.channelId, (counts.get(record.channelId) ?? 0) + 1);
    first = first === undefined || record.logTime < first ? record.logTime : first;
    last = last === undefined || record.logTime > last ? record.logTime : last;
  }
}
demand(stream.done(), 'it does not end as it should');
demand(stream.bytesRemaining() === 0, 'bytes are left behind its end');
demand(found.Chunk.every((chunk) => chunk.uncompressedCrc !== 0), 'a chunk has no checksum');

// ---------------------------------------------------------------- by the index

const readable = {
  size: async () => BigInt(bytes.length),
  read: async (offset, length) => bytes.slice(Number(offset), Number(offset + length)),
};
const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers });
const { statistics, chunkIndexes, metadataIndexes, footer } = reader;
demand(reader.header.profile === 'ros2', `its profile is ${reader.header.profile}`);
demand(footer.summaryCrc !== 0, 'its summary has no checksum');
demand(chunkIndexes.length === found.Chunk.length, 'its chunk indexes are not those of its chunks');
chunkIndexes.forEach((index, place) => {
  const chunk = found.Chunk[place];
  demand(
    index.messageStartTime === chunk.messageStartTime &&
      index.messageEndTime === chunk.messageEndTime &&
      index.uncompressedSize === chunk.uncompressedSize &&
      index.compression === chunk.compression &&
      index.messageIndexOffsets.size > 0,
    `chunk ${place} is not what its index says`,
  );
});
const metadata = [];
for await (const record of reader.readMetadata()) metadata.push(record);
demand(metadataIndexes.length === found.Metadata.length, 'a metadata record is not in the index');
demand(
  metadata.every((record, place) => record.name === found.Metadata[place].name),
  'the metadata index leads elsewhere',
);
const expected = {
  messageCount: BigInt(found.Message),
  schemaCount: reader.schemasById.size,
  channelCount: reader.channelsById.size,
  attachmentCount: found.Attachment.length,
  metadataCount: found.Metadata.length,
  chunkCount: found.Chunk.length,
  messageStartTime: first,
  messageEndTime: last,
};
for (const [name, value] of Object.entries(expected)) {
  demand(statistics[name] === value, `statistics: ${name} is ${statistics[name]}, not ${value}`);
}
for (const id of reader.channelsById.keys()) {
  const counted = statistics.channelMessageCounts.get(id) ?? 0n;
  demand(counted === BigInt(counts.get(id) ?? 0), `statistics: messages of channel ${id}`);
}
// Groups of schemas, channels, statistics, chunk and metadata indexes.
demand([3, 4, 8, 11, 13].every((code) => reader.summaryOffsetsByOpcode.has(code)), 'summary offsets');

// ---------------------------------------------------------------- the messages

const view = new DataView(new ArrayBuffer(8));
const bits = (value) => {
  view.setFloat64(0, value);
  return view.getBigUint64(0).toString(16).padStart(16, '0');
};
const plain = (types, fields, value) => {
  const item = ({ isComplex, type }, part) => {
    if (isComplex) return plain(types, types.get(type), part);
    return type === 'float64' ? bits(part) : part;
  };
  const entry = (field) => {
    const part = value[field.name];
    return field.isArray ? Array.from(part, (one) => item(field, one)) : item(field, part);
  };
  const variables = fields.filter((field) => !field.isConstant);
  return Object.fromEntries(variables.map((field) => [field.name, entry(field)]));
};

const decoders = new Map();
for (const [id, channel] of reader.channelsById) {
  const schema = reader.schemasById.get(channel.schemaId);
  demand(schema.encoding === 'ros2msg' && channel.messageEncoding === 'cdr', channel.topic);
  const types = parse(new TextDecoder().decode(schema.data), { ros2: true });
  const message = new MessageReader(types);
  const byName = new Map(types.map(({ name, definitions }) => [name ?? '', definitions]));
  decoders.set(id, (data) => plain(byName, byName.get(''), message.readMessage(data)));
}
const lines = [];
for await (const message of reader.readMessages({ validateCrcs: true })) {
  const { topic } = reader.channelsById.get(message.channelId);
  const times = [message.logTime, message.publishTime].map(String);
  const row = { topic, times, message: decoders.get(message.channelId)(message.data) };
  lines.push(JSON.stringify(row));
}
demand(lines.length === found.Message, 'the index does not lead to every message');
console.log(JSON.stringify({ faults, metadata: metadata.map(({ name }) => name) }));
console.log(lines.join('\n'));
await file.close();
