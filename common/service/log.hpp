// Private to this folder: the one logger, to standard error and to the topic log_record.
#pragma once

#include <memory>

#include "service/service.hpp"

namespace railfix::service {

std::shared_ptr<spdlog::logger> make_logger(messaging::Participant& participant, const std::string& service,
                                            const CommonConfig& common);

}  // namespace railfix::service
