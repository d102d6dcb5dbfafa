// Would catch a URL that Sprag reads differently from liblcm.
#include "lcmtypes/lcm_url.h"

#include <gtest/gtest.h>

namespace sprag {
namespace {

TEST(LcmUrlTest, ReadsGroupPortAndArguments) {
  const LcmUrl url = parse_url("udpm://239.1.2.3:9999?recv_buf_size=100&ttl=7");
  ASSERT_TRUE(url.multicast);
  EXPECT_EQ(url.multicast->group, "239.1.2.3");
  EXPECT_EQ(url.multicast->port, 9999);
  EXPECT_EQ(url.multicast->ttl, 7);
  EXPECT_EQ(url.receive_buffer, 100);
  EXPECT_FALSE(parse_url(default_url).receive_buffer);
  EXPECT_EQ(parse_url("udpm://239.1.2.3:9999?x=1,ttl=1").multicast->ttl, 1);
}

TEST(LcmUrlTest, EmptyTargetIsLcmDefault) {
  EXPECT_EQ(parse_url("udpm://?ttl=1").multicast->group, "239.255.76.67");
  EXPECT_EQ(parse_url("udpm://").multicast->port, 7667);
}

TEST(LcmUrlTest, OtherProvidersAreNotMulticast) {
  for (const char* text : {"memq://", "file://some.log?speed=0", "tcpq://localhost:7700"})
    EXPECT_FALSE(parse_url(text).multicast) << text;
}

TEST(LcmUrlTest, UrlsThatLcmMisreadsAreRefused) {
  for (const char* text :
       {"", "239.255.76.67:7667", "udp://239.255.76.67:7667", "udpm:/x", "udpm://localhost:7667",
        "udpm://10.0.0.1:7667", "udpm://239.255.76.67", "udpm://239.255.76.67:0",
        "udpm://239.255.76.67:70000", "udpm://239.255.76.67:76x", "udpm://239.255.76.67:7667?ttl=x",
        "udpm://239.255.76.67:7667?ttl=256", "udpm://239.255.76.67:7667?ttl=-1",
        "udpm://239.255.76.67:7667?recv_buf_size=0", "udpm://239.255.76.67:7667?recv_buf_size=1k"})
    EXPECT_THROW(parse_url(text), UrlError) << text;
}

}  // namespace
}  // namespace sprag
