// Our scenarios `flooding`, `contention_broadcast`, `contention_unicast` and `hidden_terminal` in ns-3.44.
//
// 802.11b or a ad hoc, addresses known from the start; by default 11 Mb/s and a UDP payload of 1024 bytes. Topologies:
// `grid`, where every node sends each new packet once more after U(0, jitter); `disc` of 100 m radius; `chain`, all on a
// line; `hidden`, three on a line, of which the ends send; `line`, nodes at `places`, each of which broadcasts what `sends`
// says and nothing else. Node 0 is the leader of the grid, the sink of unicast and the middle of `hidden`. Channel A:
// range 250 m; B: log-distance, with Jakes' fading if there is a `doppler`.
// Prints one line of JSON: CPU seconds of Simulator::Run, frames sent, and shares; of a `line` when who began to transmit.
//
// Not part of the product; ns-3 links under its own licence.
#include "ns3/core-module.h"
#include "ns3/internet-module.h"
#include "ns3/mobility-module.h"
#include "ns3/neighbor-cache-helper.h"
#include "ns3/network-module.h"
#include "ns3/propagation-module.h"
#include "ns3/wifi-module.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <ctime>
#include <iterator>
#include <sstream>
#include <string>
#include <unordered_set>
#include <vector>

using namespace ns3;

static const uint16_t PORT = 9000;

struct Settings
{
    std::string topology = "grid", channel = "A", cast = "broadcast", arrivals = "cbr", places, sends, standard = "b", rate = "11", errors;
    double interval = 1.0, duration = 100, jitter = 0.01, spacing = 200, doppler = 0;
    uint32_t nodes = 45, sources = 44, columns = 9, payload = 1024, run = 1;

    bool Unicast() const { return cast == "unicast"; }
};

static std::vector<int64_t>
Numbers(std::string text)
{
    std::replace(text.begin(), text.end(), ',', ' '); // ns-3 reads a setting up to the first blank
    std::istringstream words(text);
    return {std::istream_iterator<int64_t>(words), std::istream_iterator<int64_t>()};
}

static struct
{
    uint64_t generated = 0, sent = 0, delivered = 0, received = 0, attempts = 0, failed = 0, given_up = 0;
} g_counts;

class Station : public Object
{
  public:
    Station(Ptr<Node> node, const Settings& settings, Ipv4Address destination)
        : m_settings(settings), m_destination(destination), m_id(node->GetId()),
          m_uniform(CreateObject<UniformRandomVariable>()), m_exponential(CreateObject<ExponentialRandomVariable>())
    {
        m_exponential->SetAttribute("Mean", DoubleValue(settings.interval));
        m_socket = Socket::CreateSocket(node, UdpSocketFactory::GetTypeId());
        m_socket->SetAllowBroadcast(true);
        m_socket->Bind(InetSocketAddress(Ipv4Address::GetAny(), PORT));
        m_socket->SetRecvCallback(MakeCallback(&Station::Receive, this));
    }

    void Start()
    {
        double first = m_settings.arrivals == "poisson" ? Gap() : m_uniform->GetValue(0, m_settings.interval);
        Simulator::Schedule(Seconds(first), &Station::Generate, this);
    }

    void SendAt(Time start, uint32_t bytes)
    {
        Simulator::Schedule(start, &Station::Send, this, Create<Packet>(bytes));
    }

  private:
    double Gap() { return m_settings.arrivals == "poisson" ? m_exponential->GetValue() : m_settings.interval; }

    void Generate()
    {
        if (Simulator::Now().GetSeconds() >= m_settings.duration - 1)
            return;
        ++g_counts.generated;
        uint64_t key = (uint64_t(m_id) << 32) | m_seq++;
        m_seen.insert(key);
        std::vector<uint8_t> bytes(m_settings.payload);
        std::memcpy(bytes.data(), &key, sizeof key);
        Send(Create<Packet>(bytes.data(), bytes.size()));
        Simulator::Schedule(Seconds(Gap()), &Station::Generate, this);
    }

    void Send(Ptr<Packet> packet)
    {
        ++g_counts.sent;
        m_socket->SendTo(packet, 0, InetSocketAddress(m_destination, PORT));
    }

    void Receive(Ptr<Socket> socket)
    {
        while (Ptr<Packet> packet = socket->Recv())
        {
            ++g_counts.received;
            uint64_t key = 0;
            packet->CopyData(reinterpret_cast<uint8_t*>(&key), sizeof key);
            if (!m_seen.insert(key).second)
                continue;
            ++g_counts.delivered;
            if (m_settings.topology != "grid")
                continue;
            Ptr<Packet> copy = packet->Copy();
            copy->RemoveAllPacketTags();
            Simulator::Schedule(Seconds(m_uniform->GetValue(0, m_settings.jitter)), &Station::Send, this, copy);
        }
    }

    const Settings& m_settings;
    Ipv4Address m_destination;
    uint32_t m_id, m_seq = 0;
    Ptr<Socket> m_socket;
    Ptr<UniformRandomVariable> m_uniform;
    Ptr<ExponentialRandomVariable> m_exponential;
    std::unordered_set<uint64_t> m_seen;
};

static std::string g_began;

static void
TransmissionBegins(uint32_t node, Ptr<const Packet> packet, double)
{
    g_counts.attempts += packet->GetSize() > 14; // no ACK
    std::ostringstream began;
    began << (g_began.empty() ? "[" : ", [") << node << ", " << Simulator::Now().GetNanoSeconds() << "]";
    g_began += began.str();
}

static void
AttemptFailed(Mac48Address)
{
    ++g_counts.failed;
}

static void
GivenUp(Mac48Address)
{
    ++g_counts.given_up;
}

static Settings
Parse(int argc, char** argv)
{
    Settings s;
    CommandLine cmd;
    cmd.AddValue("topology", "grid, disc, chain, hidden or line", s.topology);
    cmd.AddValue("places", "of the nodes of the line [m], separated by commas", s.places);
    cmd.AddValue("sends", "on the line: node, instant [ns] and bytes of each broadcast, separated by commas", s.sends);
    cmd.AddValue("channel", "A or B", s.channel);
    cmd.AddValue("cast", "broadcast or unicast", s.cast);
    cmd.AddValue("arrivals", "cbr, poisson or saturated", s.arrivals);
    cmd.AddValue("interval", "between packets of a source [s]", s.interval);
    cmd.AddValue("duration", "[s]; nothing is generated in the last second", s.duration);
    cmd.AddValue("jitter", "most that a relay waits [s]", s.jitter);
    cmd.AddValue("standard", "b or a", s.standard);
    cmd.AddValue("rate", "of data [Mb/s]", s.rate);
    cmd.AddValue("errors", "of OFDM: nist or tables; by default ns-3's own", s.errors);
    cmd.AddValue("payload", "of UDP [bytes]", s.payload);
    cmd.AddValue("spacing", "of the grid, the chain and hidden nodes [m]", s.spacing);
    cmd.AddValue("columns", "of the grid", s.columns);
    cmd.AddValue("doppler", "greatest of Jakes' fading [Hz]; 0: none", s.doppler);
    cmd.AddValue("nodes", "with the sink", s.nodes);
    cmd.AddValue("sources", "nodes 1, 2, ... of the grid", s.sources);
    cmd.AddValue("run", "seed", s.run);
    cmd.Parse(argc, argv);
    if (s.topology == "hidden")
        s.nodes = 3;
    if (s.topology == "line")
        s.nodes = Numbers(s.places).size();
    if (s.arrivals == "saturated")
        s.interval = s.standard == "a" ? 0.0002 : 0.001;
    return s;
}

static void
Place(const NodeContainer& nodes, const Settings& s)
{
    Ptr<ListPositionAllocator> places = CreateObject<ListPositionAllocator>();
    Ptr<UniformRandomVariable> uniform = CreateObject<UniformRandomVariable>();
    const double middle_and_ends[] = {1, 0, 2};
    for (uint32_t i = 0; i < s.nodes; ++i)
    {
        double radius = 100 * std::sqrt(uniform->GetValue(0, 1)), angle = uniform->GetValue(0, 2 * M_PI);
        if (s.topology == "grid")
            places->Add(Vector(s.spacing * (i % s.columns), s.spacing * (i / s.columns), 0));
        else if (s.topology == "chain")
            places->Add(Vector(s.spacing * i, 0, 0));
        else if (s.topology == "hidden")
            places->Add(Vector(s.spacing * middle_and_ends[i], 0, 0));
        else if (s.topology == "line")
            places->Add(Vector(Numbers(s.places)[i], 0, 0));
        else
            places->Add(Vector(radius * std::cos(angle), radius * std::sin(angle), 0));
    }
    MobilityHelper mobility;
    mobility.SetPositionAllocator(places);
    mobility.SetMobilityModel("ns3::ConstantPositionMobilityModel");
    mobility.Install(nodes);
}

static NetDeviceContainer
Radios(const NodeContainer& nodes, const Settings& s)
{
    YansWifiChannelHelper channel;
    YansWifiPhyHelper phy;
    channel.SetPropagationDelay("ns3::ConstantSpeedPropagationDelayModel");
    if (s.channel == "A")
        channel.AddPropagationLoss("ns3::RangePropagationLossModel", "MaxRange", DoubleValue(250));
    else
    {
        channel.AddPropagationLoss("ns3::LogDistancePropagationLossModel", "Exponent", DoubleValue(3),
                                   "ReferenceDistance", DoubleValue(1), "ReferenceLoss", DoubleValue(40.05));
        if (s.doppler > 0)
        {
            Config::SetDefault("ns3::JakesProcess::DopplerFrequencyHz", DoubleValue(s.doppler));
            channel.AddPropagationLoss("ns3::JakesPropagationLossModel");
        }
        phy.Set("TxPowerStart", DoubleValue(30));
        phy.Set("TxPowerEnd", DoubleValue(30));
    }
    phy.SetChannel(channel.Create());
    if (!s.errors.empty())
        phy.SetErrorRateModel(s.errors == "nist" ? "ns3::NistErrorRateModel" : "ns3::TableBasedErrorRateModel");
    WifiMacHelper mac;
    mac.SetType("ns3::AdhocWifiMac");
    WifiHelper wifi;
    wifi.SetStandard(s.standard == "a" ? WIFI_STANDARD_80211a : WIFI_STANDARD_80211b);
    std::string mode = (s.standard == "a" ? "OfdmRate" : "DsssRate") + s.rate + "Mbps";
    std::replace(mode.begin(), mode.end(), '.', '_');
    StringValue rate(mode);
    wifi.SetRemoteStationManager("ns3::ConstantRateWifiManager", "DataMode", rate, "ControlMode", rate,
                                 "NonUnicastMode", rate);
    NetDeviceContainer devices = wifi.Install(phy, mac, nodes);
    for (uint32_t i = 0; i < devices.GetN(); ++i)
    {
        Ptr<WifiNetDevice> device = DynamicCast<WifiNetDevice>(devices.Get(i));
        device->GetPhy()->TraceConnectWithoutContext("PhyTxBegin", MakeBoundCallback(&TransmissionBegins, i));
        device->GetRemoteStationManager()->TraceConnectWithoutContext("MacTxDataFailed", MakeCallback(&AttemptFailed));
        device->GetRemoteStationManager()->TraceConnectWithoutContext("MacTxFinalDataFailed", MakeCallback(&GivenUp));
    }
    return devices;
}

int
main(int argc, char** argv)
{
    const Settings s = Parse(argc, argv);
    RngSeedManager::SetRun(s.run);
    if (s.arrivals == "saturated")
        Config::SetDefault("ns3::WifiMacQueue::MaxDelay", TimeValue(Seconds(1000)));
    NodeContainer nodes;
    nodes.Create(s.nodes);
    Place(nodes, s);
    NetDeviceContainer devices = Radios(nodes, s);
    InternetStackHelper internet;
    internet.Install(nodes);
    Ipv4AddressHelper addresses;
    addresses.SetBase("10.0.0.0", "255.255.255.0");
    Ipv4InterfaceContainer interfaces = addresses.Assign(devices);
    NeighborCacheHelper().PopulateNeighborCache();

    const bool all = (s.topology == "disc" || s.topology == "chain") && !s.Unicast();
    Ipv4Address destination = s.Unicast() ? interfaces.GetAddress(0) : Ipv4Address("255.255.255.255");
    std::vector<Ptr<Station>> stations;
    for (uint32_t i = 0; i < s.nodes; ++i)
    {
        stations.push_back(Create<Station>(nodes.Get(i), s, destination));
        if (all || (i > 0 && s.topology != "line" && (s.topology != "grid" || i <= s.sources)))
            stations.back()->Start();
    }
    const std::vector<int64_t> sends = Numbers(s.sends);
    for (size_t i = 0; i + 2 < sends.size(); i += 3)
        stations.at(sends[i])->SendAt(NanoSeconds(sends[i + 1]), sends[i + 2]);
    std::clock_t began = std::clock();
    Simulator::Stop(Seconds(s.duration));
    Simulator::Run();
    const double cpu_s = double(std::clock() - began) / CLOCKS_PER_SEC;
    if (s.topology == "line")
    {
        std::printf("{\"began\": [%s]}\n", g_began.c_str());
        stations.clear();
        Simulator::Destroy();
        return 0;
    }
    const double ended = g_counts.attempts - g_counts.failed + g_counts.given_up; // acknowledged, or given up
    const double targets = s.Unicast() || s.topology == "hidden" ? 1 : s.nodes - 1;
    std::printf("{\"cpu_s\": %.3f, \"sent\": %lu, \"pdr\": %.6f, \"air.pdr\": %.6f, \"air.throughput_mbps\": %.6f, "
                "\"air.attempt_failure\": %.6f, \"air.mean_retries\": %.6f}\n",
                cpu_s, g_counts.sent, g_counts.delivered / (targets * g_counts.generated),
                g_counts.received / (targets * g_counts.attempts), g_counts.received * 8e-6 * s.payload / s.duration,
                double(g_counts.failed) / g_counts.attempts, (g_counts.failed - g_counts.given_up) / std::max(1.0, ended));
    stations.clear();
    Simulator::Destroy();
    return 0;
}
