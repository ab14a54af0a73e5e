// Private to this folder: a reader that wants only every n-th sample of a topic. It is a content filter (DDS 1.4,
// 2.2.2.3.3) with a class of our own, which Fast DDS asks where the sample is written: the others are not even sent.
#pragma once

#include <fastdds/dds/topic/IContentFilterFactory.hpp>

namespace railfix::messaging {

inline constexpr const char* kEveryNth = "railfix.every_nth";

/// Lets samples pass whose number is a multiple of the first parameter, so both ends always agree on which.
eprosima::fastdds::dds::IContentFilterFactory& every_nth_filters();

}  // namespace railfix::messaging
