// The layouts of message 136 and packet 58, written down once and visited by encoder, decoder and printers.
// A visitor has field(Field, value) and field_if(present, when, Field, optional value).
#pragma once

#include "etcs/report_parameters.hpp"
#include "etcs/train_position_report.hpp"

namespace railfix::etcs {

constexpr Field kNidMessage = full_field("NID_MESSAGE", 8);
constexpr Field kLMessage = full_field("L_MESSAGE", 10);
constexpr Field kNidPacket = full_field("NID_PACKET", 8);
constexpr Field kLPacket = full_field("L_PACKET", 13);
constexpr Field kQScale{"Q_SCALE", 2, 2};
constexpr unsigned kPacketHeadBits = kNidPacket.bits + kLPacket.bits;

template <class Report, class Visitor>
void visit_header(Report& report, Visitor& visitor) {
  visitor.field(full_field("T_TRAIN", 32), report.t_train);
  visitor.field(full_field("NID_ENGINE", 24), report.nid_engine);
}

/// Packet 0 or 1 after NID_PACKET and L_PACKET. REQUIRES: report.nid_packet is 0 or 1.
template <class Report, class Visitor>
void visit_position(Report& report, Baseline baseline, Visitor& visitor) {
  const bool b4 = baseline == Baseline::b4;
  visitor.field(kQScale, report.q_scale);
  visitor.field(full_field("NID_LRBG", 24), report.nid_lrbg);
  visitor.field_if(report.nid_packet == 1, "NID_PACKET 1", full_field("NID_PRVLRBG", 24), report.nid_prvlrbg);
  visitor.field(full_field("D_LRBG", 15), report.d_lrbg);
  visitor.field(Field{"Q_DIRLRBG", 2, 2}, report.q_dirlrbg);
  visitor.field(Field{"Q_DLRBG", 2, 2}, report.q_dlrbg);
  visitor.field(full_field("L_DOUBTOVER", 15), report.l_doubtover);
  visitor.field(full_field("L_DOUBTUNDER", 15), report.l_doubtunder);
  visitor.field(full_field(b4 ? "Q_INTEGRITY" : "Q_LENGTH", 2), report.q_length);
  const bool confirmed = report.q_length == 1 || report.q_length == 2;
  visitor.field_if(confirmed, b4 ? "Q_INTEGRITY 1 or 2" : "Q_LENGTH 1 or 2", full_field("L_TRAININT", 15),
                   report.l_trainint);
  visitor.field(b4 ? Field{"V_TRAIN", 7, 120, kStandstillSpeed} : Field{"V_TRAIN", 7, 120}, report.v_train);
  visitor.field(Field{"Q_DIRTRAIN", 2, 2}, report.q_dirtrain);
  visitor.field(b4 ? Field{"M_MODE", 5, 17} : full_field("M_MODE", 4), report.m_mode);
  visitor.field(Field{"M_LEVEL", 3, b4 ? kLevel2 : kLevel3}, report.m_level);
  visitor.field_if(report.m_level == kLevelNtc, "M_LEVEL 1", full_field("NID_NTC", 8), report.nid_ntc);
}

/// Packet 58: in front of L_PACKET, and behind it up to the locations.
constexpr Field kQDir{"Q_DIR", 2, 2};
constexpr Field kNIter = full_field("N_ITER", 5);

template <class Parameters, class Visitor>
void visit_cycles(Parameters& parameters, Visitor& visitor) {
  visitor.field(kQScale, parameters.q_scale);
  visitor.field(full_field("T_CYCLOC", 8), parameters.t_cycloc);
  visitor.field(full_field("D_CYCLOC", 15), parameters.d_cycloc);
  visitor.field(Field{"M_LOC", 3, kReportNotAtGroups}, parameters.m_loc);
}

template <class Location, class Visitor>
void visit_location(Location& location, Visitor& visitor) {
  visitor.field(full_field("D_LOC", 15), location.d_loc);
  visitor.field(full_field("Q_LGTLOC", 1), location.q_lgtloc);
}

}  // namespace railfix::etcs
