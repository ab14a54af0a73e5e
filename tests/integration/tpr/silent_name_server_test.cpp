// A name server that does not answer: the system's call that asks it.
#include <dlfcn.h>
#include <netdb.h>

#include <atomic>
#include <chrono>
#include <string_view>

#include "integration/tpr/ground_link_fixture.hpp"

namespace {

constexpr std::string_view kSilent = "broker.silent.example";
std::atomic<int> asked = 0;
std::atomic<int> waiting = 0;
std::atomic<bool> silent = true;

}  // namespace

using Lookup = int (*)(const char*, const char*, const addrinfo*, addrinfo**);

extern "C" int getaddrinfo(const char* node, const char* service, const addrinfo* hints, addrinfo** found) {
  static const auto library = reinterpret_cast<Lookup>(dlsym(RTLD_NEXT, "getaddrinfo"));
  if (node == nullptr || node != kSilent) return library(node, service, hints, found);
  ++asked;
  ++waiting;
  while (silent) poll(nullptr, 0, 10);
  --waiting;
  return EAI_AGAIN;
}

namespace railfix {
namespace {

using ::testing::HasSubstr;

TEST_F(GroundLinkTest, EndsAtOnceWhileTheNameServerIsSilent) {
  const auto before = std::chrono::steady_clock::now();
  {
    tpr_publisher::GroundLink link(link_settings(std::string(kSilent) + ":1883"));
    link.send(report(1));
    ASSERT_TRUE(wait_for([] { return waiting == 1; }));
  }
  EXPECT_LT(std::chrono::steady_clock::now() - before, std::chrono::seconds(5));
  EXPECT_EQ(asked, 1);
  silent = false;
  ASSERT_TRUE(wait_for([] { return waiting == 0; }));
  tpr_publisher::GroundLink link(link_settings(std::string(kSilent) + ":1883"));
  EXPECT_TRUE(wait_for([&] { return link.trouble().find(gai_strerror(EAI_AGAIN)) != std::string::npos; }));
  EXPECT_THAT(link.trouble(), HasSubstr("broker.silent.example"));
  EXPECT_THAT(link.trouble(), HasSubstr("1 reports wait"));
}

}  // namespace
}  // namespace railfix
