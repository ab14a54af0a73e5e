#include "tpr_publisher/told_parameters.hpp"

#include <algorithm>
#include <cstdlib>
#include <utility>

namespace railfix::tpr_publisher {

bool ToldParameters::remember(const std::string& notes) {
  const size_t blank = std::min(notes.find(' '), notes.size());
  const auto kept = etcs::parse_hex(notes.substr(0, blank));
  if (!kept.ok()) return false;
  const uint64_t lrbg = std::strtoull(notes.c_str() + blank, nullptr, 10);
  const bool known = lrbg > 0 && lrbg < etcs::kUnknownBaliseGroup;
  if (!etcs::decode_report_parameters(kept.value()).ok()) return false;
  used_ = {kept.value(), known ? static_cast<uint32_t>(lrbg) : etcs::kUnknownBaliseGroup};
  begin_anew();
  return true;
}

bool ToldParameters::is_known(std::span<const uint8_t> packet, std::optional<uint32_t> lrbg) const {
  const auto& last = newer_ ? newer_ : used_;
  return last && std::ranges::equal(packet, last->bytes) && (!lrbg || lrbg == last->origin);
}

// Who begins anew counts from 0 again: that is no packet yet.
bool ToldParameters::hear(std::span<const uint8_t> packet, bool just_come, uint32_t lrbg, uint32_t count) {
  const bool said = lrbg != 0 && etcs::names_group(lrbg);
  auto origin = said ? std::optional(lrbg) : std::nullopt;
  const bool once_more = count_ > 0 && count > count_;
  count_ = count;
  if (packet.empty() || (is_known(packet, origin) && !once_more)) return false;
  if (!said && !just_come) origin = etcs::kUnknownBaliseGroup;
  newer_ = {{packet.begin(), packet.end()}, origin};
  return try_newer();
}

bool ToldParameters::hear_deleted() {
  if (!used_ && !newer_) return false;
  used_.reset();
  newer_.reset();
  waits_ = false;
  refusal_.clear();
  publisher_.delete_parameters();
  return true;
}

// Once it is known where locations count from they are not moved to where a later process begins.
bool ToldParameters::follow() {
  const auto origin = publisher_.origin();
  if (used_ && origin) used_->origin = origin;
  given_up_ = used_ && publisher_.locations_given_up();
  return waits_ && publisher_.direction_known(newer_->origin) && try_newer();
}

// It was for this train's orientation when it came.
void ToldParameters::begin_anew() {
  if (!used_) return;
  auto parameters = etcs::decode_report_parameters(used_->bytes).value();
  parameters.q_dir = etcs::kUnknownSide;
  core::ok_or_throw(publisher_.set_parameters(parameters, used_->origin));
}

core::Status ToldParameters::take_newer() {
  waits_ = false;
  const auto parameters = etcs::decode_report_parameters(newer_->bytes);
  if (!parameters.ok()) return parameters.error();
  waits_ = !publisher_.direction_known(newer_->origin);
  return publisher_.set_parameters(parameters.value(), newer_->origin);
}

bool ToldParameters::try_newer() {
  const auto taken = take_newer();
  refusal_ = taken.ok() ? "" : "packet 58 of onboard_status is not used: " + taken.error().message;
  if (!taken.ok()) return false;
  waits_ = given_up_ = false;
  used_ = std::exchange(newer_, std::nullopt);
  return true;
}

std::string ToldParameters::notes() const {
  if (!used_) return "";
  const bool known = used_->origin && *used_->origin != etcs::kUnknownBaliseGroup;
  return etcs::to_hex(used_->bytes) + (known && !given_up_ ? ' ' + std::to_string(*used_->origin) : "");
}

}  // namespace railfix::tpr_publisher
