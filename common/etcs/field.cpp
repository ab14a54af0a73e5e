#include "etcs/field.hpp"

namespace railfix::etcs {

std::string sentence(const SpareValue& spare) {
  return std::string(spare.field) + " = " + std::to_string(spare.value) + " is a spare value.";
}

void FieldReader::field(const Field& field, uint32_t& value) {
  if (!status_.ok()) return;
  if (bits_.left() < field.bits) {
    status_ = core::Error{"The message ends inside " + std::string(field.name) + " at bit " +
                          std::to_string(bits_.position()) + ": " + std::to_string(field.bits) + " bits needed, " +
                          std::to_string(bits_.left()) + " left."};
    return;
  }
  value = bits_.read(field.bits);
  if (field.meaningful(value)) return;
  if (spare_ != nullptr) {
    spare_->push_back({field.name, value});
  } else {
    status_ = core::Error{sentence({field.name, value})};
  }
}

void FieldReader::field_if(bool present, const char* /*when*/, const Field& field, std::optional<uint32_t>& value) {
  value.reset();
  if (present) this->field(field, value.emplace());
}

void FieldWriter::field(const Field& field, uint32_t value) {
  if (!status_.ok()) return;
  if (value > field.limit()) {
    status_ = core::Error{std::string(field.name) + " = " + std::to_string(value) +
                          " does not fit: its range is 0 to " + std::to_string(field.limit()) + "."};
  } else if (!field.meaningful(value)) {
    status_ = core::Error{sentence({field.name, value})};
  } else {
    bits_.write(value, field.bits);
  }
}

void FieldWriter::field_if(bool present, const char* when, const Field& field, const std::optional<uint32_t>& value) {
  if (!status_.ok()) return;
  if (present && value) {
    this->field(field, *value);
  } else if (present != value.has_value()) {
    status_ = core::Error{std::string(field.name) +
                          (present ? " is missing: it must be there when " : " must not be there: it goes only with ") +
                          when + "."};
  }
}

core::Status read_padding(BitReader& bits) {
  const size_t position = bits.position();
  while (bits.left() > 0) {
    if (bits.read_bit()) return core::Error{"The padding after bit " + std::to_string(position) + " is not zero."};
  }
  return {};
}

}  // namespace railfix::etcs
