#include "tpr_publisher/told_parameters.hpp"

#include <algorithm>
#include <cstdlib>
#include <string_view>
#include <utility>

namespace railfix::tpr_publisher {

namespace {

constexpr std::string_view kOver = " over";

}  // namespace

bool ToldParameters::remember(const std::string& notes) {
  const size_t blank = std::min(notes.find(' '), notes.size());
  const auto kept = etcs::parse_hex(notes.substr(0, blank));
  if (!kept.ok()) return false;
  char* end = nullptr;
  const uint64_t lrbg = std::strtoull(notes.c_str() + blank, &end, 10);
  const bool known = lrbg > 0 && lrbg < etcs::kUnknownBaliseGroup;
  if (!etcs::decode_report_parameters(kept.value()).ok()) return false;
  used_ = {kept.value(), known ? static_cast<uint32_t>(lrbg) : etcs::kUnknownBaliseGroup,
           std::string_view(end) == kOver};
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
  if (packet.empty()) {
    if (count == 0 || count < count_.value_or(0)) count_ = count;
    return false;
  }
  const bool once_more = count_ && count > *count_;
  count_ = count > 0 ? std::optional(count) : std::nullopt;
  if (is_known(packet, origin) && !once_more) return false;
  if (!said && !just_come) origin = etcs::kUnknownBaliseGroup;
  newer_ = {{packet.begin(), packet.end()}, origin};
  return try_newer(false);
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
  if (used_ && publisher_.locations_given_up()) used_->over = true;
  return waits_ && publisher_.direction_known(newer_->origin) && try_newer(true);
}

// It was for this train's orientation when it came.
void ToldParameters::begin_anew() {
  if (!used_) return;
  auto parameters = etcs::decode_report_parameters(used_->bytes).value();
  parameters.q_dir = etcs::kUnknownSide;
  core::ok_or_throw(publisher_.set_parameters(parameters, used_->over ? etcs::kUnknownBaliseGroup : used_->origin));
}

core::Status ToldParameters::take_newer(bool waited) {
  waits_ = false;
  const auto parameters = etcs::decode_report_parameters(newer_->bytes);
  if (!parameters.ok()) return parameters.error();
  waits_ = !publisher_.direction_known(newer_->origin);
  return publisher_.set_parameters(parameters.value(), newer_->origin, waited);
}

bool ToldParameters::try_newer(bool waited) {
  const auto taken = take_newer(waited);
  refusal_ = taken.ok() ? "" : "packet 58 of onboard_status is not used: " + taken.error().message;
  if (!taken.ok()) return false;
  waits_ = false;
  used_ = std::exchange(newer_, std::nullopt);
  return true;
}

std::string ToldParameters::notes() const {
  if (!used_) return "";
  const bool known = used_->origin && *used_->origin != etcs::kUnknownBaliseGroup;
  if (!known) return etcs::to_hex(used_->bytes);
  return etcs::to_hex(used_->bytes) + ' ' + std::to_string(*used_->origin) + std::string(used_->over ? kOver : "");
}

}  // namespace railfix::tpr_publisher
