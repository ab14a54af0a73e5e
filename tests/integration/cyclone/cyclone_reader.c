// Reads train_state and train_position_report live with Cyclone DDS and prints what it read, a line a sample.
// usage: railfix-cyclone-reader DOMAIN PARTITION STATES REPORTS SECONDS
// Ends with 0 when it has read that many of each, with 1 when the time is up.
#include <dds/dds.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

#include "position.h"

enum { kBatch = 32, kDepth = 64 };

static void must(dds_return_t code, const char* what) {
  if (code >= 0) return;
  fprintf(stderr, "cyclone reader: %s: %s\n", what, dds_strretcode(-code));
  exit(2);
}

// The requested quality of service is the one that our own readers request (common/messaging/topics.hpp).
static dds_entity_t make_reader(dds_entity_t participant, dds_entity_t subscriber, const dds_topic_descriptor_t* type,
                                const char* name, dds_durability_kind_t durability, dds_duration_t deadline) {
  const dds_entity_t topic = dds_create_topic(participant, type, name, NULL, NULL);
  must(topic, name);
  dds_qos_t* qos = dds_create_qos();
  dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_MSECS(100));
  dds_qset_durability(qos, durability);
  dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, kDepth);
  dds_qset_deadline(qos, deadline);
  const dds_entity_t reader = dds_create_reader(subscriber, topic, qos, NULL);
  must(reader, name);
  dds_delete_qos(qos);
  return reader;
}

static void print_state(const void* sample) {
  const railfix_msg_TrainState* s = sample;
  printf("train_state %" PRId64 " %" PRId64 " %" PRIu64, s->stamp_ns, s->grabbed_ns, s->seq);
  const double numbers[] = {s->offset_m, s->distance_m, s->speed_mps,    s->acceleration_mps2, s->over_m,
                            s->under_m,  s->sigma_m,    s->visual_scale, s->wheel_scale,       s->since_reference_m,
                            s->lat_deg,  s->lon_deg,    s->easting_m,    s->northing_m,        s->heading_rad};
  for (size_t i = 0; i < sizeof numbers / sizeof *numbers; ++i) printf(" %.17g", numbers[i]);
  printf(" %" PRIu32 " %" PRIu32 " %" PRIu32 " %u %u %u %u\n", s->edge, s->reference, s->sources, s->direction,
         s->track_known, s->integrity, s->standstill);
}

static void print_report(const void* sample) {
  const railfix_msg_TrainPositionReport* r = sample;
  printf("train_position_report %" PRId64 " %" PRId64 " %" PRIu64, r->stamp_ns, r->sent_ns, r->seq);
  printf(" %.17g %.17g %.17g %.17g", r->d_lrbg_m, r->l_doubtover_m, r->l_doubtunder_m, r->v_train_kmh);
  printf(" %" PRIu32 " %" PRIu32 " %" PRIu32 " %" PRIu32, r->nid_engine, r->nid_lrbg, r->nid_prvlrbg, r->message_bytes);
  printf(" %u %u %u %u %u %u ", r->nid_packet, r->q_dirlrbg, r->q_dlrbg, r->q_dirtrain, r->baseline, r->reason);
  for (uint32_t i = 0; i < r->message_bytes && i < sizeof r->message; ++i) printf("%02X", r->message[i]);
  printf("\n");
}

static long take_all(dds_entity_t reader, void (*print)(const void*)) {
  void* samples[kBatch] = {NULL};
  dds_sample_info_t infos[kBatch];
  const dds_return_t taken = dds_take(reader, samples, infos, kBatch, kBatch);
  must(taken, "take");
  long valid = 0;
  for (dds_return_t i = 0; i < taken; ++i) {
    if (!infos[i].valid_data) continue;
    print(samples[i]);
    ++valid;
  }
  if (taken > 0) dds_return_loan(reader, samples, taken);
  fflush(stdout);
  return valid;
}

int main(int argc, char** argv) {
  if (argc != 6) {
    fprintf(stderr, "usage: %s DOMAIN PARTITION STATES REPORTS SECONDS\n", argv[0]);
    return 2;
  }
  const char* partition = argv[2];
  long states = strtol(argv[3], NULL, 10);
  long reports = strtol(argv[4], NULL, 10);
  const dds_time_t deadline = dds_time() + DDS_SECS(strtol(argv[5], NULL, 10));

  const dds_entity_t participant = dds_create_participant((dds_domainid_t)strtoul(argv[1], NULL, 10), NULL, NULL);
  must(participant, "participant");
  dds_qos_t* qos = dds_create_qos();
  dds_qset_partition(qos, 1, &partition);
  const dds_entity_t subscriber = dds_create_subscriber(participant, qos, NULL);
  must(subscriber, "subscriber");
  dds_delete_qos(qos);
  const dds_entity_t state_reader = make_reader(participant, subscriber, &railfix_msg_TrainState_desc, "train_state",
                                                DDS_DURABILITY_VOLATILE, DDS_MSECS(200));
  const dds_entity_t report_reader = make_reader(participant, subscriber, &railfix_msg_TrainPositionReport_desc,
                                                 "train_position_report", DDS_DURABILITY_TRANSIENT_LOCAL, DDS_INFINITY);

  const dds_entity_t waitset = dds_create_waitset(participant);
  must(dds_waitset_attach(waitset, dds_create_readcondition(state_reader, DDS_ANY_STATE), 0), "waitset");
  must(dds_waitset_attach(waitset, dds_create_readcondition(report_reader, DDS_ANY_STATE), 0), "waitset");
  while ((states > 0 || reports > 0) && dds_time() < deadline) {
    dds_attach_t triggered[2];
    must(dds_waitset_wait_until(waitset, triggered, 2, deadline), "wait");
    states -= take_all(state_reader, print_state);
    reports -= take_all(report_reader, print_report);
  }
  dds_delete(participant);
  return states > 0 || reports > 0 ? 1 : 0;
}
