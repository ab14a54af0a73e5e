#include <gmock/gmock.h>

#include "ground_link/mqtt_client.hpp"

namespace railfix::ground_link {
namespace {

using ::testing::HasSubstr;

MqttOptions tls(const std::string& ca, const std::string& certificate, const std::string& key) {
  MqttOptions options;
  options.host = "g";
  options.ca_file = ca;
  options.certificate_file = certificate;
  options.key_file = key;
  return options;
}

TEST(MqttOptions, ACertificateWithoutAnAuthorityWouldGoUnused) {
  for (const auto& options : {tls("", "", ""), tls("ca", "", ""), tls("ca", "c", "k")})
    EXPECT_TRUE(check_tls(options).ok());
  for (const auto& options : {tls("", "c", "k"), tls("", "c", ""), tls("", "", "k")})
    EXPECT_THAT(check_tls(options).error().message, HasSubstr("name the authority, too (ca_file, --ca)"));
  for (const auto& options : {tls("ca", "c", ""), tls("ca", "", "k")})
    EXPECT_THAT(check_tls(options).error().message, HasSubstr("go together"));
  EXPECT_THROW(MqttClient(tls("", "c", "k"), {}), core::BadInput) << "whoever makes it";
}

TEST(MqttOptions, ATopicToWriteToIsOneTopic) {
  for (const std::string& topic :
       {std::string("railfix/demo/position_report"), std::string("a"), std::string("zug/\u00e4")})
    EXPECT_TRUE(check_topic(topic).ok()) << topic;
  for (const std::string& topic : {std::string(), std::string("railfix/+/report"), std::string("railfix/#"),
                                   std::string("a+b"), std::string("\xff"), std::string(65536, 'a')})
    EXPECT_THAT(check_topic(topic).error().message, HasSubstr("is no topic to write to")) << topic.substr(0, 20);
}

TEST(MqttOptions, APasswordInPlainTextIsTold) {
  auto options = tls("", "", "");
  options.user = "train";
  EXPECT_EQ(plain_password(options), "");
  options.password = "secret";
  EXPECT_EQ(plain_password(options),
            "the password goes in plain text to g:1883; name the broker's authority (ca_file, --ca), and its port for "
            "TLS (8883)");
  options.ca_file = "ca";
  EXPECT_EQ(plain_password(options), "");
}

}  // namespace
}  // namespace railfix::ground_link
