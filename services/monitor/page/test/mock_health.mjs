// Services, topics, recorder and problems of the made-up train, by scenario.
const NAMES = ["frame_grabber", "sensor_gateway", "track_detector", "odometry", "map_matcher", "fusion", "tpr_publisher", "recorder", "monitor"];
const wobble = (i) => Math.sin(Date.now() / 3000 + i);

export function services_of(scenario, began) {
  return NAMES.filter((name) => scenario !== "no_recorder" || name !== "recorder").map((service, i) => {
    const dead = scenario === "dead" && service === "odometry";
    const degraded = { blind: "track_detector", no_gnss: "sensor_gateway", disk_full: "recorder" }[scenario] === service;
    const reason = { blind: "Camera covered: much of the track's part of the picture shows nothing.", no_gnss: "GNSS receiver is silent.",
      disk_full: "The disk has less than keep_free_mb: nothing is written." }[scenario];
    return {
      service, host: i < 4 ? "cab" : "coach", state: degraded ? "degraded" : "active", reason: degraded ? reason : "", since_ns: (began - (degraded ? 42e3 : 3.7e6)) * 1e6,
      age_s: dead ? 38 : 0.1, alive: !dead, version: "0.1.0", pid: 4100 + i, cpu_percent: 8 + i + 2 * wobble(i), rss_mb: 40 + 9 * i, frames_in: 221000 + i, frames_out: 220990 + i,
      dropped: dead ? 12 : 0, latency_p50_ms: 2.1 + i, latency_p99_ms: 6.4 + 2 * i + wobble(i), matches: 12,
    };
  });
}

const TOPICS = [["camera_frame/cam0", 60, 0], ["camera_preview/cam0", 5, 210000], ["train_state", 60, 13000], ["track_view", 60, 62000], ["odometry_step", 60, 7800],
  ["position_fix", 1.4, 220], ["landmark_sighting", 1.1, 90], ["imu_sample", 200, 17600], ["wheel_sample", 100, 4000], ["gnss_fix", 1, 64], ["train_position_report", 0.2, 30],
  ["service_status", 36, 9000], ["log_record", 0.6, 120]];

export function topics_of(scenario) {
  return TOPICS.map(([topic, hz, bytes_per_s], i) => {
    const silent = scenario === "no_gnss" && topic === "gnss_fix";
    return {
      topic, type: "railfix::msg::Any", writers: silent ? 0 : 1, hz: silent ? 0 : hz + 0.2 * wobble(i), bytes_per_s: silent ? 0 : bytes_per_s, age_s: silent ? 83 : 0.5 / hz,
      latency_p50_ms: silent ? null : 0.4 + i / 10, latency_p95_ms: silent ? null : 0.8 + i / 10, latency_p99_ms: silent ? null : 1.9 + i / 10,
      lost: topic === "track_view" ? 3 : 0, gaps: topic === "imu_sample" ? 2 : 0, longest_gap_s: topic === "imu_sample" ? 0.031 : 0, measured: topic !== "camera_frame/cam0",
    };
  });
}

export function recorder_of(scenario, state, began) {
  if (scenario === "no_recorder") return { kind: "recorder", absent: true };
  const s = (Date.now() - began) / 1000;
  const full = scenario === "disk_full";
  return {
    kind: "recorder", stamp_ns: Date.now() * 1e6, started_ns: state === "stopped" ? 0 : began * 1e6, event_ns: (began - 65e3) * 1e6, messages: Math.round(s * 520), bytes: Math.round(s * 1.3e6),
    bytes_per_s: state === "recording" ? 1.31e6 : 0, queue_mb: 0.4, ring_s: 30, kept_mb: full ? 49980 : 31200, quota_mb: 50000, disk_free_mb: full ? 480 : 61000, files: 41, protected_files: 3,
    state, file: state === "stopped" ? "" : "/data/recordings/drive-0007.mcap", event: "Emergency brake",
    lost: full ? [{ topic: "camera_frame/cam0", transport: 0, encoder: 4, queue: 310, disk: 1204 }, { topic: "train_state", transport: 1, encoder: 0, queue: 0, disk: 88 }] : [],
  };
}

export function problems_of(scenario, began) {
  const one = (id, level, what, what_to_do, ago_s) => ({ id, level, what, what_to_do, since_ns: (began - ago_s * 1000) * 1e6 });
  return {
    no_gnss: [one("gnss", "warning", "GNSS is silent", "The position goes on without it. Check antenna and receiver at the next stop.", 83)],
    blind: [one("camera", "error", "Camera cam0 sees no rails: covered", "Clean the window in front of the camera. Until then the interval grows with the way.", 42),
      one("interval", "warning", "The confidence interval is longer than 20 m", "Reports go on with the larger interval.", 21)],
    dead: [one("odometry", "error", "odometry on cab has been silent for 38 s", "It is started again by itself; if it stays away, look at its log with 'railfix log -f'.", 38)],
    unknown: [one("track", "error", "It is not known on which track the train is", "Reports name no track until the next switch or balise group decides it.", 15)],
    disk_full: [one("disk", "error", "The recorder has stopped: only 480 MB are free on its disk", "Free space in /data/recordings, then press Start.", 65)],
    silent: [one("state", "error", "fusion says no position any more", "Look at the services below.", 5)],
  }[scenario] ?? [];
}
