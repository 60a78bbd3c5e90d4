// usage: node read_mcap.mjs FILE.mcap FLIGHT OUT, where `epiline replay FLIGHT --mcap FILE.mcap --out OUT` wrote the file. Reads it with
// Foxglove's own readers and compares every number with the recording and with the results. Needs, in the folder where it runs:
// npm install @mcap/core @foxglove/rosmsg @foxglove/rosmsg2-serialization fzstd pngjs
import { createRequire } from "node:module";
import { open, readFile } from "node:fs/promises";
import { execFileSync } from "node:child_process";
const require = createRequire(process.cwd() + "/");
const { McapIndexedReader, McapStreamReader } = require("@mcap/core");
const { parse } = require("@foxglove/rosmsg");
const { MessageReader } = require("@foxglove/rosmsg2-serialization");
const fzstd = require("fzstd");
const { PNG } = require("pngjs");

const [file, flight, out] = process.argv.slice(2);
const decompressHandlers = { zstd: (bytes, size) => fzstd.decompress(bytes, new Uint8Array(Number(size))) };
const handle = await open(file);
const readable = {
  size: async () => BigInt((await handle.stat()).size),
  read: async (offset, length) => {
    const bytes = new Uint8Array(Number(length));
    await handle.read(bytes, 0, bytes.length, Number(offset));
    return bytes;
  },
};

let failed = 0, compared = 0;
function same(what, got, wanted, tolerance = 0) {
  compared++;
  const equal = typeof wanted === "number" ? Math.abs(got - wanted) <= tolerance : got === wanted;
  if (!equal && failed++ < 20) console.log(`${what}: ${got}; expected ${wanted}`);
}
const table = async (path) => {
  const text = await readFile(path, "utf8");
  return text.split("\n").filter((line) => line && !line.startsWith("#")).map((line) => line.split(/[ ,]+/));
};
const nanoseconds = ({ sec, nanosec, nsec }) => BigInt(sec) * 1000000000n + BigInt(nanosec ?? nsec);
const xyz = ({ x, y, z }) => [x, y, z], xyzw = ({ x, y, z, w }) => [x, y, z, w];

// Every record once, in the order of the file: checksums of chunks and of the data.
let records = 0;
const stream = new McapStreamReader({ decompressHandlers, validateCrcs: true, includeChunks: false });
stream.append(new Uint8Array(await readFile(file)));
for (let r; (r = stream.nextRecord()); ) records++;
same("end of the stream", stream.done(), true);

// By the index.
const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers });
same("profile", reader.header.profile, "ros2");
const readers = new Map(), topics = new Map();
for (const [id, channel] of reader.channelsById) {
  const schema = reader.schemasById.get(channel.schemaId);
  same("schema encoding", schema.encoding, "ros2msg");
  same("message encoding", channel.messageEncoding, "cdr");
  readers.set(id, new MessageReader(parse(new TextDecoder().decode(schema.data), { ros2: true })));
  topics.set(channel.topic, []);
}
let count = 0n, last = 0n;
for await (const message of reader.readMessages({ validateCrcs: true })) {
  const content = readers.get(message.channelId).readMessage(message.data);
  const stamp = content.header?.stamp ?? content.transforms?.[0].header.stamp ?? content.points?.[0].timestamp;
  same("log time", message.logTime, nanoseconds(stamp));
  same("order", message.logTime >= last, true);
  last = message.logTime;
  topics.get(reader.channelsById.get(message.channelId).topic).push(content);
  count++;
}
same("messages", count, reader.statistics.messageCount);

const near = (what, got, wanted, tolerance) => wanted.forEach((w, i) => same(`${what}[${i}]`, got[i], Number(w), tolerance * Math.max(1, Math.abs(Number(w)))));
const rows = (await readFile(out + "/odometry.csv", "utf8")).split("\n").slice(1).filter((line) => line).map((line) => line.split(","));
const odometry = rows.filter((row) => Number(row[12]) !== 0); // an origin has no variance
same("odometry", topics.get("/epiline/odometry").length, odometry.length);
topics.get("/epiline/odometry").forEach((m, i) => {
  const row = odometry[i];
  same("time", nanoseconds(m.header.stamp), BigInt(row[0]));
  same("frames", m.header.frame_id + m.child_frame_id, "odombase_link");
  near("position", xyz(m.pose.pose.position), row.slice(1, 4), 1e-8);
  near("orientation", xyzw(m.pose.pose.orientation), [...row.slice(5, 8), row[4]], 1e-8);
  const C = m.pose.covariance;
  near("covariance", [C[0], C[1], C[2], C[7], C[8], C[14], C[35], C[21], C[22], C[28]], row.slice(12, 22), 1e-6);
  for (let r = 0; r < 6; ++r) for (let c = 0; c < r; ++c) same("symmetry", C[6 * r + c], C[6 * c + r]);
  // the velocity is that of the body: turned into the world it is the file's
  const [x, y, z, w] = xyzw(m.pose.pose.orientation), v = xyz(m.twist.twist.linear);
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const t = cross([x, y, z], v).map((e) => 2 * e), u = cross([x, y, z], t);
  near("velocity", v.map((e, k) => e + w * t[k] + u[k]), row.slice(8, 11), 1e-6);
  const pose = topics.get("/epiline/pose")[i].pose, tf = topics.get("/tf")[i].transforms[0];
  near("pose", [...xyz(pose.position), ...xyzw(pose.orientation)], [...xyz(m.pose.pose.position), ...xyzw(m.pose.pose.orientation)], 0);
  near("tf", [...xyz(tf.transform.translation), ...xyzw(tf.transform.rotation)], [...xyz(m.pose.pose.position), ...xyzw(m.pose.pose.orientation)], 0);
});

const imu = new Map((await table(flight + "/mav0/imu0/data.csv")).map((row) => [BigInt(row[0]), row.slice(1)]));
topics.get("/imu0").forEach((m) => {
  const row = imu.get(nanoseconds(m.header.stamp));
  near("rates and forces", [...xyz(m.angular_velocity), ...xyz(m.linear_acceleration)], row, 0);
  same("no orientation", m.orientation_covariance[0], -1);
});
const truth = topics.get("/ground_truth/pose") ?? [];
if (truth.length > 0) {
  const wanted = await table(flight + "/mav0/state_groundtruth_estimate0/data.csv");
  same("ground truth", truth.length, wanted.length);
  truth.forEach((m, i) => {
    same("time", nanoseconds(m.header.stamp), BigInt(wanted[i][0]));
    near("true position", xyz(m.pose.position), wanted[i].slice(1, 4), 0);
    const q = [...wanted[i].slice(5, 8), wanted[i][4]].map(Number); // a file may have a quaternion that is not quite of length 1
    near("true orientation", xyzw(m.pose.orientation), q.map((e) => e / Math.hypot(...q)), 1e-12);
  });
}
const names = new Map((await table(flight + "/mav0/cam0/data.csv")).map((row) => [BigInt(row[0]), row[1].trim()]));
const images = topics.get("/cam0/image_raw/compressed") ?? [], tracks = topics.get("/cam0/tracks");
for (const [i, m] of images.entries()) {
  const name = names.get(nanoseconds(m.header.stamp));
  const got = PNG.sync.read(Buffer.from(m.data)), wanted = PNG.sync.read(await readFile(`${flight}/mav0/cam0/data/${name}`));
  same("pixels", Buffer.compare(got.data, wanted.data), 0);
  const points = tracks[i].points[0];
  same("colours", points.outline_colors.length, points.points.length);
  for (const { x, y } of points.points) same("inside", x > 0 && y > 0 && x < got.width && y < got.height, true);
}
const states = { tracking: 0, initialising: 1, degraded: 1, lost: 2 };
topics.get("/diagnostics").forEach((m, i) => {
  const status = m.status[0], values = Object.fromEntries(status.values.map(({ key, value }) => [key, value]));
  same("level", status.level, states[status.message]);
  same("tracks", Number(values.tracks), tracks[i].points[0].points.length);
});

for (const [topic, messages] of topics) console.log(`${topic}: ${messages.length}`);
console.log(`${records} records, ${count} messages, ${compared} comparisons, ${failed} differences`);
process.exit(failed ? 1 : 0);
